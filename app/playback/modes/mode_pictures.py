"""Modes that are pictures of numbers: depth, opacity, normals, overdraw and solid bodies. Their colours are those of a
map on a range that stays the same over time. Runs on the thread that draws.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from app.playback.modes.arrays import BACKGROUND
from app.playback.modes.color_maps import mapped
from app.playback.modes.view_modes import MODES

if TYPE_CHECKING:
    from engine.backends.backend import Backend
    from engine.raster.gaussians import Gaussians
    from engine.raster.pinhole_view import PinholeView

MIN_OPACITY = 0.1
"""Where less than this is covered, no depth is known."""
EDGE_SHARE = 0.03
"""Neighbouring depths that differ by more than this share belong to different surfaces."""


def mode_picture(
    mode: str,
    gaussians: Gaussians,
    view: PinholeView,
    value_range: tuple[float, float],
    set_back: float = 0.0,
    *,
    backend: Backend,
) -> tuple[np.ndarray, np.ndarray | None]:
    """A picture in one of the modes with `is_picture`.

    Args:
        mode: Its name.
        gaussians: The Gaussians to draw, float32 in main memory; rows that cannot be drawn are left out.
        value_range: From app.playback.modes.view_modes.range_of.
        backend: The back end that draws depth and opacity.
        set_back: How much farther away the camera stands than it seems to, which depths leave out. Scene units
    Returns:
        image: [H, W, 3] uint8
        values: The numbers of its colours, NaN where nothing is; None where they stand for none. [H, W] float32
    Raises:
        ValueError: It is not such a mode.
    """
    match mode:
        case "depth":
            depth, opacity = _depth_and_opacity(gaussians, view, set_back, backend)
            return _over_background(mapped(depth, MODES[mode].map_name, *value_range), opacity, depth), depth
        case "opacity":
            _, opacity = _depth_and_opacity(gaussians, view, set_back, backend)
            return mapped(opacity, MODES[mode].map_name, *value_range), opacity
        case "normals":
            depth, opacity = _depth_and_opacity(gaussians, view, set_back, backend)
            normals = normals_of(depth, view, set_back)
            colors = 255.0 * (0.5 + 0.5 * np.nan_to_num(normals) * (1.0, 1.0, -1.0))
            return _over_background(colors, opacity, normals[..., 2]), None
        case "overdraw":
            from engine.backends.inspection.overdraw import overdraw

            counts = overdraw(gaussians, view).astype(np.float32)
            counts[counts == 0.0] = np.nan
            return mapped(counts, MODES[mode].map_name, *value_range, nothing=BACKGROUND), counts
        case "ellipsoids":
            from engine.backends.inspection.ellipsoids import ellipsoids

            image, _ = ellipsoids(gaussians, view, BACKGROUND)
            return (image * 255.0 + 0.5).astype(np.uint8), None
        case _:
            raise ValueError(f"{mode!r} is not a mode that is a picture of numbers")


def _depth_and_opacity(
    gaussians: Gaussians, view: PinholeView, set_back: float, backend: Backend
) -> tuple[np.ndarray, np.ndarray]:
    """Depth, NaN where next to nothing is, and opacity. [H, W] float32 each"""
    import torch

    from engine.model.host_array import host_array

    if set_back > 0.0:  # depths from so far away are too coarse in float32: the rest of them is drawn as colours
        depths = gaussians.means.numpy() @ view.rotation[2] + (view.translation[2] - set_back)
        colors = torch.from_numpy(np.repeat(depths[:, None], 3, axis=1).astype(np.float32))
        gaussians = replace(gaussians, colors=colors)
    with torch.no_grad():
        gaussians = gaussians.to(backend.device, backend.dtype)
        nothing = gaussians.means.new_zeros(3)
        rendering = backend.rasterize(
            gaussians, [view], nothing, tile_mask=None, want_means2d=False, want_depth=set_back <= 0.0
        )
        opacity, depth = host_array(rendering.alpha[0, :, :, 0]), rendering.expected_depth
    if depth is None:
        with np.errstate(invalid="ignore", divide="ignore"):
            shown = host_array(rendering.image[0, :, :, 0]) / opacity
    else:
        shown = host_array(depth[0, :, :, 0])
    return np.where(opacity >= MIN_OPACITY, shown, np.nan).astype(np.float32), opacity


def _over_background(colors: np.ndarray, opacity: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Colours as opaque as the depicted scene, over the background alone where nothing is known. [H, W, 3] uint8"""
    share = np.where(np.isnan(known), 0.0, np.clip(opacity, 0.0, 1.0)).astype(np.float32)[..., None]
    background = np.array(BACKGROUND, np.float32) * np.float32(255.0)
    return (colors * share + background * (np.float32(1.0) - share) + np.float32(0.5)).astype(np.uint8)


def normals_of(depth: np.ndarray, view: PinholeView, set_back: float = 0.0) -> np.ndarray:
    """Unit normals of the surface that a picture of depths shows, from central differences.

    Across the edge of a surface only the side that belongs to it counts.

    Args:
        depth: Camera depth without `set_back`, NaN where nothing is. [H, W]
        set_back: Scene units, see `mode_picture`.
    Returns:
        In camera axes (x right, y down, z forward), turned towards the camera; NaN where there are no neighbours.
        [H, W, 3] float32
    """
    y, x = np.mgrid[0 : view.height, 0 : view.width].astype(np.float32)
    rays = np.stack([(x + 0.5 - view.cx) / view.fx, (y + 0.5 - view.cy) / view.fy, np.ones_like(x)], axis=-1)
    points = np.concatenate([rays[..., :2] * (depth + set_back)[..., None], depth[..., None]], axis=-1)
    normals = np.cross(_difference(points, depth, axis=1), _difference(points, depth, axis=0))
    with np.errstate(invalid="ignore", divide="ignore"):
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        faces_away = (normals * rays).sum(axis=-1, keepdims=True) > 0.0
    return np.where(faces_away, -normals, normals).astype(np.float32)


def _difference(points: np.ndarray, depth: np.ndarray, axis: int) -> np.ndarray:
    """Change of a point per pixel along an axis of the picture: from both neighbours, or the one on its surface."""
    steps, jumps = np.diff(points, axis=axis), np.abs(np.diff(depth, axis=axis))
    with np.errstate(invalid="ignore"):
        nearer = np.minimum(
            np.take(depth, range(depth.shape[axis] - 1), axis), np.take(depth, range(1, depth.shape[axis]), axis)
        )
        is_edge = ~(jumps <= EDGE_SHARE * nearer)
    steps = np.where(is_edge[..., None], np.nan, steps)
    pad = [(0, 0), (0, 0), (0, 0)]
    pad[axis] = (1, 1)
    padded = np.pad(steps, pad, constant_values=np.nan)
    n = points.shape[axis]
    before, after = np.take(padded, range(n), axis), np.take(padded, range(1, n + 1), axis)
    both = 0.5 * (before + after)
    return np.where(np.isnan(both), np.where(np.isnan(before), after, before), both)
