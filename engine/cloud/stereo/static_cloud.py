"""The static scene as points: depth maps of the backgrounds by a multi-view sweep, checked, filled and fused.

No shape is assumed (no floor, no dome): the same steps serve a ring of cameras, a room and a forward-facing rig.
What moves is not here (engine.cloud.motion.moving_cloud).
Letters: C cameras, H W full pictures, h w working pictures (about 160 x 90).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from engine.camera.projection import focal_px, is_in_picture, project, projection_matrices, unproject
from engine.camera.rig import CameraRig
from engine.cloud.background.gains import gain_spread, gains_from_observations, scene_colors
from engine.cloud.fusion import Samples, fuse_tiers, keep_inliers
from engine.cloud.keeping import Keep, do_now
from engine.cloud.stereo.depth_maps import MIN_AGREE, DepthMaps, estimate_depth_maps
from engine.cloud.stereo.unseen import backdrop, unseen_points
from engine.errors import PreparationError
from engine.images.image_filters import block_mean

Report = Callable[[str], None]

SPACING_PX = 5.0
"""Point spacing in full-size pixels at the median depth, unless max_points asks for coarser ones."""
UNSEEN_SHARE = 0.12
"""Share of all points that are kept for places where no camera looks."""
COLOR_DEPTH_TOLERANCE = 0.05
MIN_VALID_SHARE = 0.99
"""A working pixel of which less is seen has its colour mixed with black."""


@dataclass(frozen=True, slots=True)
class StaticCloud:
    """Points of everything that does not move.

    Attributes:
        points: [P, 3] float32, scene units.
        colors: White-balanced (median camera) display colour in 0..1. [P, 3] float32
        sizes: How large the Gaussians of a point are to begin with, scene units: the spacing, and more where no camera
            looks. [P] float32
        gains: camera_colour = gain * scene_colour. [C, 3] float32, median 1; all 1 where cameras do not differ.
        spacing: Distance between neighbouring points, scene units.
    """

    points: np.ndarray
    colors: np.ndarray
    sizes: np.ndarray
    gains: np.ndarray
    spacing: float


def build_static_cloud(
    backgrounds: np.ndarray,
    is_stable: np.ndarray,
    rig: CameraRig,
    *,
    is_valid: np.ndarray | None = None,
    max_points: int = 25_000,
    sparse_points: np.ndarray | None = None,
    color: str = "auto",
    report: Report,
    keep: Keep = do_now,
) -> StaticCloud:
    """Points, colours and per-camera gains of the static scene.

    Args:
        backgrounds: One picture per camera without what moves. [C, H, W, 3] uint8
        is_stable: False where a background cannot be trusted. [C, H, W] bool
        rig: Training cameras only, at the size of the backgrounds.
        is_valid: Pixels that the cameras see, None for all; the others are not stable and make no points. [C, H, W]
            bool
        max_points: The spacing grows until no more than this many points remain.
        sparse_points: Triangulated points [P, 3] that set the depth ranges, if there are any.
        color: "auto": gains where the cameras differ by more than the estimate errs. "gain": always. "off": never.
        report: Gets one line per step with counts and the reason.
        keep: Keeps what took long, under names that belong to these arguments alone.
    Raises:
        PreparationError: Fewer than 2 cameras, or nothing could be reconstructed.
    """
    if len(rig) < 2:
        raise PreparationError(f"{len(rig)} camera cannot give depth; at least 2 training cameras are needed.")
    first_gains, maps = estimate_depth_maps(
        backgrounds, is_stable, rig, sparse_points=sparse_points, report=report, keep=keep
    )
    started = time.perf_counter()
    working_width = len(maps.depths[0][0])
    is_seen = None if is_valid is None else _working_pictures(is_valid, working_width) > MIN_VALID_SHARE
    tiers = _sample_tiers(
        maps, _working_pictures(backgrounds, working_width) / first_gains[:, None, None], is_seen=is_seen
    )
    shares = [len(tier.points) / maps.depths.size for tier in tiers]
    report(
        f"Depth maps: {shares[0]:.0%} of pixels agreed by 2 or more cameras, {shares[1]:.0%} filled and agreed, "
        f"{shares[2]:.0%} filled and seen by one camera only (kept: holes cost more than soft walls)"
    )
    spacing = SPACING_PX * _median_footprint(maps) * maps.rig.image_sizes[0, 0] / rig.image_sizes[0, 0]
    points, _, colors = fuse_tiers(tiers, spacing)
    is_kept = keep_inliers(points)
    max_seen = max_points - int(UNSEEN_SHARE * max_points)
    for _ in range(5):
        if is_kept.sum() <= max_seen:
            break
        spacing *= 1.02 * float(np.sqrt(is_kept.sum() / max_seen))  # surface points fall with the spacing squared
        points, _, colors = fuse_tiers(tiers, spacing)
        is_kept = keep_inliers(points)
    if not is_kept.any():
        raise PreparationError("No static surface was found: no pixel is agreed on by 2 cameras.")
    report(
        f"Static cloud: {is_kept.sum()} points at {spacing:.4g} scene units, {(~is_kept).sum()} statistical outliers "
        f"removed, limit {max_points} with those where no camera looks ({time.perf_counter() - started:.1f} s)"
    )
    points, colors = points[is_kept], colors[is_kept]
    log_colors = _observe(points, backgrounds, is_stable, rig, maps)
    gains, seen_colors, decision = _balance(points, log_colors, first_gains, color)
    is_colored = np.asarray(np.isfinite(seen_colors).all(axis=1))
    colors = np.where(is_colored[:, None], seen_colors, colors)
    if is_colored.any() and not is_colored.all():
        # what only unstable pixels saw may be a person's colour on the floor: take the surroundings instead
        n_neighbors = min(4, int(is_colored.sum()))
        neighbors = np.asarray(KDTree(points[is_colored]).query(points[~is_colored], n_neighbors)[1])
        colors[~is_colored] = np.median(colors[is_colored][neighbors.reshape(len(neighbors), -1)], axis=1)
    report(
        f"White balance: {decision}; {is_colored.sum()} of {len(points)} points "
        f"coloured by the median of the cameras that see them, the rest by their neighbours"
    )
    shell, shell_colors, shell_sizes = backdrop(points, colors, maps.rig, maps.depths)
    more, more_colors, size = unseen_points(
        points, colors, maps.rig, maps.depths, spacing, max_points=max_points - len(points) - len(shell)
    )
    report(f"Unseen: {len(more)} points continue surfaces where no camera looks, {len(shell)} lie behind everything")
    sizes = np.concatenate([np.full(len(points), spacing), np.full(len(more), size), shell_sizes])
    points = np.concatenate([points, more, shell])
    colors = np.concatenate([colors, more_colors, shell_colors])
    return StaticCloud(
        points=points.astype(np.float32),
        colors=np.clip(colors / 255.0, 0.0, 1.0).astype(np.float32),
        sizes=sizes.astype(np.float32),
        gains=gains.astype(np.float32),
        spacing=float(spacing),
    )


def _working_pictures(backgrounds: np.ndarray, working_width: int) -> np.ndarray:
    factor = backgrounds.shape[2] // working_width
    return np.stack([block_mean(picture, factor) for picture in backgrounds])


def _median_footprint(maps: DepthMaps) -> float:
    """Scene units per working pixel at the median depth."""
    focal = focal_px(maps.rig.Ks)[:, None, None]
    return float(np.median(maps.depths / focal))


def _sample_tiers(maps: DepthMaps, pictures: np.ndarray, *, is_seen: np.ndarray | None) -> list[Samples]:
    """Oriented coloured points in three tiers of trust: agreed, filled and agreed, filled and uncontradicted.

    Args:
        is_seen: Pixels that the cameras see at all; None for all. [C, h, w] bool
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
            part.append(Samples(points[rows], normals[rows], pictures[camera][rows]))
    return [
        Samples(*(np.concatenate([getattr(s, name) for s in part]) for name in ("points", "normals", "colors")))
        for part in parts
    ]


def _observe(
    points: np.ndarray, backgrounds: np.ndarray, is_stable: np.ndarray, rig: CameraRig, maps: DepthMaps
) -> np.ndarray:
    """log(colour + 1) of the points in the cameras that see them unoccluded, NaN elsewhere. [C, P, 3] float32"""
    factor = max(1, backgrounds.shape[2] // int(maps.rig.image_sizes[0, 0]))
    log_colors = np.full((len(rig), len(points), 3), np.nan, dtype=np.float32)
    for camera, projection in enumerate(projection_matrices(rig)):
        half = max(1, factor // 2)
        picture, stable = block_mean(backgrounds[camera], half), block_mean(is_stable[camera], half) > 0.99
        pixels, depths = project(points, projection)
        rows = np.flatnonzero(is_in_picture(pixels, depths, picture.shape[1] * half, picture.shape[0] * half))
        x, y = (pixels[rows] / half).astype(int).T
        map_x = np.minimum((pixels[rows, 0] / factor).astype(int), maps.depths.shape[2] - 1)
        map_y = np.minimum((pixels[rows, 1] / factor).astype(int), maps.depths.shape[1] - 1)
        is_front = np.abs(depths[rows] / maps.depths[camera, map_y, map_x] - 1.0) < COLOR_DEPTH_TOLERANCE
        is_good = is_front & stable[y, x]
        log_colors[camera, rows[is_good]] = np.log(picture[y[is_good], x[is_good]] + 1.0)
    return log_colors


def _balance(
    points: np.ndarray, log_colors: np.ndarray, first_gains: np.ndarray, color: str
) -> tuple[np.ndarray, np.ndarray, str]:
    """Gains [C, 3], median scene colours [P, 3] 0..255 and a line that says what was decided and why."""
    measured = gain_spread(points, log_colors)
    numbers = (
        f"gains of the cameras spread by {measured.spread:.2%}, uncertain by {measured.uncertainty:.2%} "
        f"({measured.n_cameras} of {len(first_gains)} cameras measured)"
    )
    if color == "gain" or (color == "auto" and measured.is_real):
        gains, colors = gains_from_observations(log_colors, first_gains)
        why = "cameras differ" if color == "auto" else "color=gain"
        return gains, colors, f"{why}, {numbers}; gains {gains.min():.2f} to {gains.max():.2f}"
    gains = np.ones_like(first_gains)
    why = "cameras do not differ" if color == "auto" else "color=off"
    return gains, scene_colors(log_colors, gains), f"{why}, {numbers}; no gains"
