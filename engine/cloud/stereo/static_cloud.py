"""The static scene as points: depth maps of the backgrounds by a multi-view sweep, checked, filled and fused.

No shape is assumed (no floor, no dome): the same steps serve a ring of cameras, a room and a forward-facing rig.
What moves is not here (engine.cloud.motion.moving_cloud).
Letters: C cameras, H W full pictures, h w working pictures (about 160 x 90).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.spatial import KDTree

from engine.camera.depth_range import MIN_POINTS, depth_ranges, focus_distances, near_plane
from engine.camera.projection import focal_px, is_in_picture, project, projection_matrices, unproject
from engine.camera.rig import CameraRig
from engine.cloud.background.gains import gain_spread, gains_from_observations, gains_from_pictures, scene_colors
from engine.cloud.fusion import Samples, fuse_tiers, keep_inliers
from engine.cloud.keeping import Arrays, Keep, do_now
from engine.cloud.stereo.consistency import Agreement, check_depths
from engine.cloud.stereo.fill import fill_inverse_depth
from engine.cloud.stereo.smoothing import smooth_inverse_depth
from engine.cloud.stereo.sweep import choose_sources, matching_costs, plane_inverse_depths
from engine.errors import PreparationError
from engine.images.image_filters import block_mean, erode
from engine.parallel import map_ordered

Report = Callable[[str], None]

WORKING_PIXELS = 160 * 90
"""Depth maps of about this many pixels; larger ones make the cloud no better."""
PROBE_PIXELS = 80 * 45
"""Size of the first look that finds the depth range where there are no sparse points."""
PROBE_RANGE = (0.3, 12.0)
"""Depths of that first look, in focus distances; far planes cost little in inverse depth."""
SPACING_PX = 6.0
"""Point spacing in full-size pixels at the median depth: 20k points on the 640 x 360 dome (6 cm)."""
GREY_FROM_RGB = np.array([0.299, 0.587, 0.114])
AGREE_TOLERANCE = 0.02
FILLED_TOLERANCE = 0.04
MIN_AGREE = 2
MIN_AGREED_PIXELS = 100
"""With fewer agreed pixels their range says nothing about the rest of the picture."""
COLOR_DEPTH_TOLERANCE = 0.05
MIN_VALID_SHARE = 0.99
"""A working pixel of which less is seen has its colour mixed with black."""
KEPT_CAMERAS = 8
"""Depth maps that are kept together: some seconds of work, and enough of them for every core."""


@dataclass(frozen=True, slots=True)
class StaticCloud:
    """Points of everything that does not move.

    Attributes:
        points: [P, 3] float32, scene units.
        colors: White-balanced (median camera) display colour in 0..1. [P, 3] float32
        gains: camera_colour = gain * scene_colour. [C, 3] float32, median 1; all 1 where cameras do not differ.
        spacing: Distance between neighbouring points, scene units.
    """

    points: np.ndarray
    colors: np.ndarray
    gains: np.ndarray
    spacing: float


@dataclass(frozen=True, slots=True)
class DepthMaps:
    """Complete depth maps at working size and what backs every pixel.

    Attributes:
        rig: At working size.
        depths: Camera z, positive everywhere. [C, h, w] float64
        is_agreed: At least two other cameras measured the same depth. [C, h, w] bool
        checks: Agreement of the completed maps, one per camera.
        is_usable: The background can be trusted there. [C, h, w] bool
    """

    rig: CameraRig
    depths: np.ndarray
    is_agreed: np.ndarray
    checks: list[Agreement]
    is_usable: np.ndarray


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
    for _ in range(5):
        if is_kept.sum() <= max_points:
            break
        spacing *= 1.02 * float(np.sqrt(is_kept.sum() / max_points))  # surface points fall with the spacing squared
        points, _, colors = fuse_tiers(tiers, spacing)
        is_kept = keep_inliers(points)
    if not is_kept.any():
        raise PreparationError("No static surface was found: no pixel is agreed on by 2 cameras.")
    report(
        f"Static cloud: {is_kept.sum()} points at {spacing:.4g} scene units, {(~is_kept).sum()} statistical outliers "
        f"removed, limit {max_points} ({time.perf_counter() - started:.1f} s)"
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
    return StaticCloud(
        points=points.astype(np.float32),
        colors=np.clip(colors / 255.0, 0.0, 1.0).astype(np.float32),
        gains=gains.astype(np.float32),
        spacing=float(spacing),
    )


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
    greys, is_usable, small_rig, gains = _prepare(backgrounds, is_stable, rig, WORKING_PIXELS)
    sources = choose_sources(small_rig, near, far)
    inverse, n_planes = _sweep_all(greys, is_usable, small_rig, sources, near, far, keep)
    height, width = greys.shape[1:]
    report(
        f"Depth sweep: {len(rig)} cameras at {width} x {height}, {min(n_planes)}-{max(n_planes)} planes of at most "
        f"1 px, {np.mean([len(s) for s in sources]):.1f} neighbours each ({time.perf_counter() - started:.1f} s)"
    )
    started = time.perf_counter()
    raw_depths = 1.0 / inverse

    def check_raw(camera: int) -> Agreement:
        return check_depths(raw_depths, small_rig, camera=camera, others=sources[camera], tolerance=AGREE_TOLERANCE)

    raw_checks = map_ordered(check_raw, range(len(rig)))
    is_agreed = np.stack([check.n_agree >= MIN_AGREE for check in raw_checks]) & is_usable

    def complete(camera: int) -> np.ndarray:
        check, agreed = raw_checks[camera], is_agreed[camera]
        weights = agreed * np.minimum(check.n_agree, 3) / 3.0
        low, high = 1.0 / far[camera], 1.0 / near[camera]
        if agreed.sum() >= MIN_AGREED_PIXELS:  # a plate extrapolates freely: keep it within what was measured
            nearest, farthest = np.percentile(check.depths[agreed], [1.0, 99.0])
            low, high = max(low, 0.95 / farthest), min(high, 1.1 / nearest)
        filled = fill_inverse_depth(1.0 / check.depths, weights, greys[camera], low=low, high=high)
        is_close = agreed & (np.abs(filled * check.depths - 1.0) < 0.1)
        return np.where(is_close, check.depths, 1.0 / filled)

    depths = np.stack(map_ordered(complete, range(len(rig))))

    def check_complete(camera: int) -> Agreement:
        return check_depths(depths, small_rig, camera=camera, others=sources[camera], tolerance=FILLED_TOLERANCE)

    checks = map_ordered(check_complete, range(len(rig)))
    report(
        f"Cross-check: {is_agreed.mean():.0%} of pixels agree with {MIN_AGREE} or more neighbours within "
        f"{AGREE_TOLERANCE:.0%}; the rest filled by a thin plate ({time.perf_counter() - started:.1f} s)"
    )
    return gains, DepthMaps(small_rig, depths, is_agreed, checks, is_usable)


def _working_factor(width: int, height: int, n_pixels: int) -> int:
    """Integer shrink factor that comes closest to n_pixels."""
    return max(1, round(float(np.sqrt(width * height / n_pixels))))


def _working_pictures(backgrounds: np.ndarray, working_width: int) -> np.ndarray:
    factor = backgrounds.shape[2] // working_width
    return np.stack([block_mean(picture, factor) for picture in backgrounds])


def _prepare(
    backgrounds: np.ndarray, is_stable: np.ndarray, rig: CameraRig, n_pixels: int
) -> tuple[np.ndarray, np.ndarray, CameraRig, np.ndarray]:
    """White-balanced greys [C, h, w], usable pixels [C, h, w], rig at that size and first gains [C, 3]."""
    height, width = backgrounds.shape[1:3]
    factor = _working_factor(width, height, n_pixels)
    pictures = np.stack([block_mean(picture, factor) for picture in backgrounds])
    shares = np.stack([block_mean(stable, factor) for stable in is_stable])
    is_usable = np.stack([erode(share > 0.6, 1) for share in shares])
    gains = gains_from_pictures(pictures, is_usable)
    greys = ((pictures / gains[:, None, None]) @ GREY_FROM_RGB).astype(np.float32)
    cut_sizes = np.array([[width // factor * factor, height // factor * factor]])
    cut = CameraRig(rig.names, rig.world_to_camera, rig.Ks, np.repeat(cut_sizes, len(rig), axis=0))
    return greys, is_usable, cut.resized(cut.image_sizes // factor), gains


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
    greys, is_usable, small_rig, _ = _prepare(backgrounds, is_stable, rig, PROBE_PIXELS)
    sources = choose_sources(small_rig, wide_near, wide_far)
    inverse, _ = _sweep_all(greys, is_usable, small_rig, sources, wide_near, wide_far)
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
    report(
        f"Depth range: {np.median(near):.3g} to {np.median(far):.3g} scene units (medians over cameras): coarse sweep "
        f"in {is_measured.sum()} of {len(rig)}, the rest from "
        + (f"{n_points} sparse points" if has_points else "the focus distance")
    )
    return near, far


def _sweep_all(
    greys: np.ndarray,
    is_usable: np.ndarray,
    rig: CameraRig,
    sources: list[list[int]],
    near: np.ndarray,
    far: np.ndarray,
    keep: Keep = do_now,
) -> tuple[np.ndarray, list[int]]:
    """Smoothed inverse depth of every camera [C, h, w] float64 and the planes each one used."""

    def sweep_one(camera: int) -> tuple[np.ndarray, int]:
        planes = plane_inverse_depths(rig, camera, sources[camera], near[camera], far[camera])
        costs = matching_costs(greys, is_usable, rig, camera=camera, sources=sources[camera], inverse_depths=planes)
        return smooth_inverse_depth(costs, greys[camera], planes), len(planes)

    def sweep(cameras: range) -> Arrays:
        results = map_ordered(sweep_one, cameras)
        return {
            "inverse": np.stack([result[0] for result in results]),
            "n_planes": np.array([result[1] for result in results]),
        }

    parts = []
    for first in range(0, len(rig), KEPT_CAMERAS):
        cameras = range(first, min(first + KEPT_CAMERAS, len(rig)))
        parts.append(keep(f"depth maps from {first}", partial(sweep, cameras)))
    inverse = np.concatenate([part["inverse"] for part in parts]).astype(np.float64)
    return inverse, [int(n) for part in parts for n in part["n_planes"]]


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
