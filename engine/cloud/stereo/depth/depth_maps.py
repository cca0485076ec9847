"""Depth maps of all backgrounds: a sweep of planes, then slanted patches, each checked by other cameras and filled.

Letters: C cameras, H W full pictures, h w working pictures (about 160 x 90).
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

import numpy as np

from engine.camera.depth_range import MIN_POINTS, depth_ranges, focus_distances, near_plane
from engine.camera.rig import CameraRig
from engine.cloud.kept_results import Arrays, Keep, do_now
from engine.cloud.stereo.depth.consistency import check_depths
from engine.cloud.stereo.depth.depth_scene import (
    AGREE_TOLERANCE,
    MIN_AGREE,
    WORKING_PIXELS,
    DepthMaps,
    DepthScene,
    prepared,
    sweep_all,
)
from engine.cloud.stereo.depth.sweep import choose_sources

logger = logging.getLogger(__name__)

Report = Callable[[str], None]

PROBE_PIXELS = 80 * 45
"""Size of the first look that finds the depth range where there are no sparse points."""
PROBE_RANGE = (0.3, 12.0)
"""Depths of that first look, in focus distances; far planes cost little in inverse depth."""


def estimate_depth_maps(
    backgrounds: np.ndarray,
    is_stable: np.ndarray,
    rig: CameraRig,
    *,
    sparse_points: np.ndarray | None,
    report: Report,
    keep: Keep = do_now,
) -> tuple[np.ndarray, DepthMaps]:
    """First gains [C, 3] and a complete, checked depth map per camera. Arguments as in build_static_cloud."""
    started = time.perf_counter()

    def search() -> Arrays:
        near, far = _search_ranges(backgrounds, is_stable, rig, sparse_points, report)
        return {"near": near, "far": far}

    ranges = keep("depth range", search)
    near, far = ranges["near"], ranges["far"]
    greys, is_usable, small_rig, gains = prepared(backgrounds, is_stable, rig, WORKING_PIXELS)
    sources = choose_sources(small_rig, near, far)
    inverse, n_planes = sweep_all(greys, is_usable, small_rig, sources, near, far, keep)
    height, width = greys.shape[1:]
    report(f"Depth maps: {len(rig)} cameras at {width} x {height}")
    logger.info(
        "depth sweep: %d to %d planes of at most 1 px, %.1f neighbours each; %.1f s",
        *(min(n_planes), max(n_planes), np.mean([len(s) for s in sources]), time.perf_counter() - started),
    )
    started = time.perf_counter()
    scene = DepthScene(greys, is_usable, small_rig, sources, near, far, gains)
    swept, depths = scene.completed(inverse)
    prior = 1.0 / depths
    maps = DepthMaps.of(scene, scene.better(scene.refined(np.stack([prior, inverse]), prior, keep), inverse))
    report(f"Depth maps: neighbours agree on {100 * maps.is_agreed.mean():.0f} % of the pixels; the rest is filled in")
    logger.info(
        "slanted patches: %.0f %% before; agreed is what %d or more neighbours have within %.0f %%; %.1f s",
        *(100 * swept.mean(), MIN_AGREE, 100 * AGREE_TOLERANCE, time.perf_counter() - started),
    )
    return gains, maps


def _search_ranges(
    backgrounds: np.ndarray,
    is_stable: np.ndarray,
    rig: CameraRig,
    sparse_points: np.ndarray | None,
    report: Report,
) -> tuple[np.ndarray, np.ndarray]:
    """Depth range per camera: a coarse sweep over a wide range, stretched towards the sparse points if there are any.

    Points alone are not enough: they lie on texture, and a few wrong ones near a camera would double the planes.
    """
    near, far = depth_ranges(rig, sparse_points)
    point_near, point_far = near.copy(), far.copy()
    n_points = 0 if sparse_points is None else len(sparse_points)
    has_points = n_points >= MIN_POINTS
    distances = focus_distances(rig)
    wide_near = np.maximum(PROBE_RANGE[0] * distances, near_plane(rig))
    wide_far = PROBE_RANGE[1] * distances
    if has_points:
        wide_near, wide_far = np.minimum(wide_near, near), np.maximum(wide_far, far)
    greys, is_usable, small_rig, _ = prepared(backgrounds, is_stable, rig, PROBE_PIXELS)
    sources = choose_sources(small_rig, wide_near, wide_far)
    inverse, _ = sweep_all(greys, is_usable, small_rig, sources, wide_near, wide_far)
    depths = 1.0 / inverse
    is_measured = np.zeros(len(rig), dtype=bool)
    for camera in range(len(rig)):
        check = check_depths(depths, small_rig, camera=camera, others=sources[camera], tolerance=0.03)
        seen = check.depths[(check.n_agree >= MIN_AGREE) & is_usable[camera]]
        if len(seen) >= 0.05 * is_usable[camera].size:
            low, high = np.percentile(seen, [2.0, 98.0])
            near[camera] = max(0.8 * low, wide_near[camera])
            far[camera] = max(1.3 * high, 1.5 * near[camera])
            is_measured[camera] = True
    if has_points:
        near = np.where(is_measured, np.minimum(near, np.maximum(point_near, 0.8 * near)), near)
        far = np.where(is_measured, np.maximum(far, np.minimum(point_far, 1.25 * far)), far)
    report(f"Depths: {np.median(near):.3g} to {np.median(far):.3g} scene units in a typical camera")
    logger.info(
        "depth ranges: coarse sweep in %d of %d cameras, the rest from %s",
        *(is_measured.sum(), len(rig), f"{n_points} sparse points" if has_points else "the focus distance"),
    )
    return near, far
