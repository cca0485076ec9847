"""Oriented coloured points from checked depth maps, sorted by how far they can be trusted.

Letters: C cameras, H W full pictures, h w working pictures.
"""

from __future__ import annotations

import numpy as np

from engine.camera.projection import focal_px, unproject
from engine.cloud.fusion import Samples
from engine.cloud.stereo.depth.depth_scene import MIN_AGREE, DepthMaps
from engine.images.image_filters import block_mean

MIN_VALID_SHARE = 0.99
"""A working pixel of which less is seen has its colour mixed with black."""


def working_pictures(pictures: np.ndarray, working_width: int) -> np.ndarray:
    """Pictures, or masks as shares, shrunk to about this width. float32 [C, h, w(, channels)]"""
    factor = pictures.shape[2] // working_width
    return np.stack([block_mean(picture, factor) for picture in pictures])


def median_footprint(maps: DepthMaps) -> float:
    """Scene units per working pixel at the median depth."""
    focal = focal_px(maps.rig.Ks)[:, None, None]
    return float(np.median(maps.depths / focal))


def seen_pixels(is_valid: np.ndarray | None, working_width: int) -> np.ndarray | None:
    """Working pixels that the cameras see [C, h, w] bool, of those of full size [C, H, W]; None for all."""
    return None if is_valid is None else working_pictures(is_valid, working_width) > MIN_VALID_SHARE


def sample_tiers(
    maps: DepthMaps, pictures: np.ndarray, *, is_seen: np.ndarray | None, is_wanted: np.ndarray | None = None
) -> list[Samples]:
    """Oriented coloured points in three tiers of trust: agreed, filled and agreed, filled and uncontradicted.

    Args:
        maps: Depths and what backs them.
        pictures: At working size, whose colours the points get. [C, h, w, 3]
        is_seen: Pixels that the cameras see at all; None for all. [C, h, w] bool
        is_wanted: Pixels of which points are made; None for all. [C, h, w] bool
    """
    parts: list[list[Samples]] = [[], [], []]
    for camera, check in enumerate(maps.checks):
        points = unproject(maps.depths[camera], maps.rig.Ks[camera], maps.rig.world_to_camera[camera])
        normals = np.cross(np.gradient(points, axis=1), np.gradient(points, axis=0))
        normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
        agreed, usable = maps.is_agreed[camera], maps.is_usable[camera]
        is_clear = check.n_see_through == 0
        if is_seen is not None:
            is_clear = is_clear & is_seen[camera]
        is_filled_agreed = ~agreed & usable & is_clear & (check.n_agree >= MIN_AGREE)
        # behind people who never left nothing was matched, yet leaving those pixels out would leave holes
        tiers = (agreed & (check.n_see_through <= 1), is_filled_agreed, ~agreed & is_clear & ~is_filled_agreed)
        for part, rows in zip(parts, tiers, strict=True):
            rows = rows if is_wanted is None else rows & is_wanted[camera]
            part.append(Samples(points[rows], normals[rows], pictures[camera][rows]))
    return [
        Samples(*(np.concatenate([getattr(s, name) for s in part]) for name in ("points", "normals", "colors")))
        for part in parts
    ]
