"""The static scene as points: depth maps of the backgrounds by a multi-view sweep, checked, filled and fused.

No shape is assumed (no floor, no dome): the same steps serve a ring of cameras, a room and a forward-facing rig.
Moving parts are not here (engine.cloud.motion.moving_cloud).
Letters: C cameras, H W full pictures, h w working pictures (about 160 x 90).
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from engine.camera.rig import CameraRig
from engine.cloud.background.vignetting import measure_vignetting, point_radii
from engine.cloud.fusion import fuse_tiers, keep_inliers
from engine.cloud.kept_results import Keep, do_now
from engine.cloud.stereo.coloring import balance, colored_by_neighbors, observe
from engine.cloud.stereo.depth.depth_maps import estimate_depth_maps
from engine.cloud.stereo.sampling import median_footprint, sample_tiers, seen_pixels, working_pictures
from engine.cloud.stereo.unseen import backdrop, unseen_points
from engine.errors import PreparationError
from engine.images.rendition import log_falloff

logger = logging.getLogger(__name__)

Report = Callable[[str], None]

SPACING_PX = 5.0
"""Point spacing in full-size pixels at the median depth, unless max_points asks for coarser ones."""
UNSEEN_SHARE = 0.12
"""Share of all points that are kept for places where no camera looks."""


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
        vignetting: Of the cameras' lenses, see engine.images.rendition; zeros where there is none. [C, 2] float32
    """

    points: np.ndarray
    colors: np.ndarray
    sizes: np.ndarray
    gains: np.ndarray
    spacing: float
    vignetting: np.ndarray


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
    """Points, colours, per-camera gains and vignetting of the static scene.

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
    tiers = sample_tiers(
        maps,
        working_pictures(backgrounds, working_width) / first_gains[:, None, None],
        is_seen=seen_pixels(is_valid, working_width),
    )
    shares = [len(tier.points) / maps.depths.size for tier in tiers]
    logger.info(
        "depth maps: %.0f %% of pixels agreed by 2 or more cameras, %.0f %% filled and agreed, %.0f %% filled and seen "
        "by one camera only (kept: holes cost more than soft walls)",
        *(100 * share for share in shares),
    )
    spacing = SPACING_PX * median_footprint(maps) * maps.rig.image_sizes[0, 0] / rig.image_sizes[0, 0]
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
    report(f"Static cloud: {is_kept.sum():,} points, {(~is_kept).sum():,} outliers removed")
    logger.info(
        "static cloud at %.4g scene units, limit %d with points where no camera looks; %.1f s",
        *(spacing, max_points, time.perf_counter() - started),
    )
    points, colors = points[is_kept], colors[is_kept]
    log_colors = observe(points, backgrounds, is_stable, rig, maps)
    vignetting = np.zeros((len(rig), 2), np.float32)
    if color != "off":
        lenses = measure_vignetting(points, log_colors, rig)
        vignetting = lenses.coefficients
        log_colors -= log_falloff(point_radii(points, rig), vignetting)[..., None]
        report(f"Vignetting: {lenses.text}")
    gains, seen_colors, decision = balance(points, log_colors, first_gains, color)
    n_colored = int(np.isfinite(seen_colors).all(axis=1).sum())
    colors = colored_by_neighbors(points, colors, seen_colors)
    report(f"White balance: {decision}")
    logger.info("%d of %d points coloured by the cameras that see them, the rest by neighbours", n_colored, len(points))
    shell, shell_colors, shell_sizes = backdrop(points, colors, maps.rig, maps.depths)
    more, more_colors, size = unseen_points(
        points, colors, maps.rig, maps.depths, spacing, max_points=max_points - len(points) - len(shell)
    )
    report(f"Where no camera looks: {len(more):,} points continue surfaces, {len(shell):,} lie behind everything")
    sizes = np.concatenate([np.full(len(points), spacing), np.full(len(more), size), shell_sizes])
    points = np.concatenate([points, more, shell])
    colors = np.concatenate([colors, more_colors, shell_colors])
    return StaticCloud(
        points=points.astype(np.float32),
        colors=np.clip(colors / 255.0, 0.0, 1.0).astype(np.float32),
        sizes=sizes.astype(np.float32),
        gains=gains.astype(np.float32),
        spacing=float(spacing),
        vignetting=vignetting,
    )
