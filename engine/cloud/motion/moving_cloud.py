"""Everything that moves in one clip as points: visual hulls of all its frames on one voxel grid, with presence.

A point is a place, and `presence` says in which frames something's surface was there; or it travels with the surface.
Letters: M frames of the clip, C cameras.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from engine.camera.depth_range import near_plane
from engine.camera.projection import project, projection_matrices
from engine.camera.rig import CameraRig
from engine.cloud.background.motion_masks import MotionMasks
from engine.cloud.fusion import keep_inliers
from engine.cloud.kept_results import Arrays, Keep, do_now
from engine.cloud.motion.hull import Grid, carve, hull_colors, hull_visibility, surface_rows
from engine.cloud.motion.surface_flow import surface_flow
from engine.cloud.motion.travel import follow

logger = logging.getLogger(__name__)

Report = Callable[[str], None]

VOXEL_PX = 2.5
"""Voxel edge in pixels at the median depth of the hull, unless max_points asks for coarser ones."""
MIN_HITS_SHARE = 0.25
"""Share of the cameras that must see a voxel inside their mask (at least MIN_HITS)."""
MIN_HITS = 3
MIN_VISIBLE = 1
"""Cameras that must see a surface voxel unhidden by the hull itself. Hulls also fill the space behind what they show
(under a shadow on the floor): half of the surface on the dome, and this removes it. Asking for 2 tears holes, because
what only one camera sees still hides what lies behind it."""
MISSES_FROM_CAMERAS = 8
"""One camera may disagree in rigs of at least this many; in smaller ones every view is needed."""
MAX_GRID_VOXELS = 400_000_000
"""Coarse blocks are 1 / 512 of this; bounds far beyond what the cameras see only cost time."""
MAX_CARVES = 3
"""Times the clip is carved to meet max_points; the count is known only afterwards."""
N_PROBE_VOXELS = 96
"""The first, coarse hull that finds size and depth of what moves has this many voxels along the longest edge."""


@dataclass(frozen=True, slots=True)
class MovingCloud:
    """Places where something moved.

    Attributes:
        points: Voxel centres, scene units. [P, 3] float32
        colors: White-balanced display colour in 0..1, mean over the frames it is present in. [P, 3] float32
        presence: On the hull's surface in that frame. [P, M] bool
        spacing: Voxel edge, scene units.
        motion: Frames of birth [P], velocities and accelerations [P, 3] of points that travel, see
            engine.model.motion.AnchorMotion; None where they stay. float32
    """

    points: np.ndarray
    colors: np.ndarray
    presence: np.ndarray
    spacing: float
    motion: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None

    def chosen(self, rows: np.ndarray) -> MovingCloud:
        """Some of the points. rows: [P] bool or [n] int64"""
        motion = None if self.motion is None else tuple(array[rows] for array in self.motion)
        return MovingCloud(self.points[rows], self.colors[rows], self.presence[rows], self.spacing, motion)  # pyright: ignore


def build_moving_cloud(
    frames: Callable[[int, int], np.ndarray],
    masks: MotionMasks,
    rig: CameraRig,
    gains: np.ndarray,
    *,
    bounds_min: np.ndarray,
    bounds_max: np.ndarray,
    valid_in: Callable[[int], np.ndarray | None] = lambda frame_in_clip: None,
    max_points: int = 30_000,
    voxel_size: float | None = None,
    travels: bool = False,
    report: Report,
    keep: Keep = do_now,
) -> MovingCloud:
    """Hull surfaces of every frame of a clip, fused.

    Args:
        frames: (row of the rig, frame_in_clip) -> picture [H, W, 3] uint8. Called in order from this thread.
        masks: Pixels that move.
        rig: Training cameras only, at mask size.
        gains: camera_colour = gain * scene_colour. [C, 3]
        bounds_min, bounds_max: Box to search, scene units. [3]
        valid_in: Frame in clip to the pixels that count there; None for all. [C, H, W] bool
        max_points: The voxel grows until about no more than this many points remain over the clip.
        voxel_size: Voxel edge to use as it is, scene units; a source clip takes its reference's. None derives it.
        travels: Whether points travel with the surface.
        report: Gets one line per step with counts and the reason.
        keep: Keeps what took long, under names that belong to these arguments alone.
    Returns:
        MovingCloud; empty where nothing moves.
    """
    started = time.perf_counter()
    n_frames, n_cameras, _, _ = masks.shape
    projections, near = projection_matrices(rig), 0.5 * near_plane(rig)
    min_hits, n_misses = hull_votes(n_cameras)
    n_hidden = 0

    def surface(frame_in_clip: int, grid: Grid) -> np.ndarray:
        nonlocal n_hidden
        found = keep(f"hull of frame {frame_in_clip} at {grid.size!r}", lambda: carve_frame(frame_in_clip, grid))
        n_hidden += int(found["n_hidden"][0])
        return found["voxels"]

    def carve_frame(frame_in_clip: int, grid: Grid) -> Arrays:
        frame_masks = masks.of_frame(frame_in_clip)
        is_valid = valid_in(frame_in_clip)
        voxels = carve(
            frame_masks, projections, grid, near=near, n_misses=n_misses, min_hits=min_hits, is_valid=is_valid
        )
        voxels = voxels[surface_rows(voxels, grid)]
        _, is_visible = hull_visibility(grid.centers(voxels), grid.size, frame_masks, projections, near=near)
        is_kept = is_visible.sum(axis=0) >= MIN_VISIBLE
        return {"voxels": voxels[is_kept], "n_hidden": np.array([(~is_kept).sum()])}

    low, high = np.asarray(bounds_min, dtype=np.float64), np.asarray(bounds_max, dtype=np.float64)
    probe = Grid.over(low, high, float((high - low).max()) / N_PROBE_VOXELS)
    coarse = [surface(m, probe) for m in range(n_frames)]
    occupied = np.concatenate(coarse)
    if len(occupied) == 0:
        report(f"Moving cloud: nothing moves where {min_hits} of {n_cameras} cameras agree; no points")
        return _empty(n_frames, probe.size)
    low = np.maximum(low, probe.centers(occupied.min(0)) - 1.5 * probe.size)
    high = np.minimum(high, probe.centers(occupied.max(0)) + 1.5 * probe.size)
    wanted = VOXEL_PX * _median_footprint(probe.centers(np.unique(occupied, axis=0)), rig, near)
    # start from what the probe promises: surface counts fall with the square of the voxel
    promised = probe.size * float(np.sqrt(_n_union(coarse) / max_points))
    size = max(wanted, promised, float((np.prod(high - low) / MAX_GRID_VOXELS) ** (1 / 3)))
    size = voxel_size or size
    n_hidden, grid, surfaces = 0, Grid.over(low, high, size), []
    for attempt in range(1 if voxel_size else MAX_CARVES):
        n_hidden, grid = 0, Grid.over(low, high, size)
        surfaces = [surface(m, grid) for m in range(n_frames)]
        n_union = _n_union(surfaces)
        if voxel_size or n_union <= 1.05 * max_points or attempt == MAX_CARVES - 1:
            break
        size *= float(np.clip(np.sqrt(n_union / max_points), 1.03, 4.0))
    voxels, presence = _fuse(surfaces)
    report(f"Moving surfaces: {np.mean([len(s) for s in surfaces]):,.0f} points a frame, {len(voxels):,} places in all")
    logger.info(
        "hulls: voxels of %.4g scene units (wanted %.4g = %s px, limit %d); %d of %d cameras must agree, %d may not; "
        "%.0f a frame dropped that no camera can see; %.1f s",
        *(size, wanted, VOXEL_PX, max_points, min_hits, n_cameras, n_misses, n_hidden / n_frames),
        time.perf_counter() - started,
    )
    if len(voxels) == 0:
        return _empty(n_frames, size)
    points = grid.centers(voxels)
    is_kept = keep_inliers(points)
    points, presence = points[is_kept], presence[is_kept]
    started = time.perf_counter()
    seen = _Seen(frames, masks, projections, near, size)
    if travels and n_frames > 1:
        cloud = _travelling(points, presence, seen, gains, keep)
        lifetime = f" in {cloud.presence.sum(1).mean():.1f} frames each"
    else:
        places = keep(
            "colours of moving points",
            lambda: {"colors": _colors(lambda frame: points, presence, seen, gains)},
        )
        cloud = MovingCloud(points.astype(np.float32), places["colors"], presence, float(size))
        lifetime = ""
    report(f"Moving cloud: {len(cloud.points):,} points{lifetime}, {(~is_kept).sum():,} outliers removed")
    logger.info("moving cloud followed and coloured in %.1f s", time.perf_counter() - started)
    return cloud


@dataclass(frozen=True, slots=True)
class _Seen:
    """What cameras see of the hulls. `frames` and `masks` as in `build_moving_cloud`; near and size in scene units."""

    frames: Callable[[int, int], np.ndarray]
    masks: MotionMasks
    projections: np.ndarray
    near: float
    size: float

    def pictures(self, frame_in_clip: int) -> np.ndarray:
        """Of all cameras. [C, H, W, 3] uint8"""
        return np.stack([self.frames(row, frame_in_clip) for row in range(len(self.projections))])

    def visibility(self, points: np.ndarray, frame_in_clip: int) -> tuple[np.ndarray, np.ndarray]:
        """See `hull_visibility`."""
        masks = self.masks.of_frame(frame_in_clip)
        return hull_visibility(points, self.size, masks, self.projections, near=self.near)


def _travelling(points: np.ndarray, presence: np.ndarray, seen: _Seen, gains: np.ndarray, keep: Keep) -> MovingCloud:
    """The cloud whose points travel, from surface points [P, 3] and their presence [P, M]."""
    n_frames = presence.shape[1]
    surfaces = [points[presence[:, frame]] for frame in range(n_frames)]

    held: dict[int, np.ndarray] = {}  # pictures of the next frame, which may come from a disk

    def flow(frame: int) -> Arrays:
        before = held.pop(frame, None)
        if len(surfaces[frame]) == 0:
            return {"steps": np.zeros((0, 3))}
        pixel, is_visible = seen.visibility(surfaces[frame], frame)
        masks = seen.masks.of_frame(frame) | seen.masks.of_frame(frame + 1)
        held[frame + 1] = seen.pictures(frame + 1)
        pictures = seen.pictures(frame) if before is None else before, held[frame + 1]
        return {"steps": surface_flow(surfaces[frame], pixel, is_visible, pictures, masks, seen.projections)}

    found = [keep(f"motion from frame {frame}", partial(flow, frame)) for frame in range(n_frames - 1)]
    travellers = follow(surfaces, [arrays["steps"] for arrays in found], seen.size)
    colors = keep(
        "colours of travelling points",
        lambda: {"colors": _colors(travellers.at, travellers.presence, seen, gains)},
    )["colors"]
    motion = travellers.birth_frames, travellers.velocities, travellers.accelerations
    return MovingCloud(
        travellers.points.astype(np.float32),
        colors,
        travellers.presence,
        float(seen.size),
        (motion[0].astype(np.float32), motion[1].astype(np.float32), motion[2].astype(np.float32)),
    )


def hull_votes(n_cameras: int) -> tuple[int, int]:
    """Cameras that must see a place of the hull inside their mask, and how many of those that look there may not."""
    min_hits = min(max(MIN_HITS, int(np.ceil(MIN_HITS_SHARE * n_cameras))), n_cameras)
    return min_hits, 1 if n_cameras >= MISSES_FROM_CAMERAS else 0


def motion_bounds(points: np.ndarray, rig: CameraRig) -> tuple[np.ndarray, np.ndarray]:
    """A box to search for motion: the static points (1 % to 99 % per axis, plus a tenth) and the focus point.

    Returns:
        bounds_min [3], bounds_max [3].
    """
    low, high = np.percentile(points, [1.0, 99.0], axis=0)
    margin = 0.1 * (high - low)
    focus = rig.focus_point()
    return np.minimum(low - margin, focus), np.maximum(high + margin, focus)


def _empty(n_frames: int, size: float) -> MovingCloud:
    nothing = np.zeros((0, 3), dtype=np.float32)
    return MovingCloud(nothing, nothing.copy(), np.zeros((0, n_frames), dtype=bool), float(size))


def _median_footprint(points: np.ndarray, rig: CameraRig, near: float) -> float:
    """Scene units per pixel at the points' median depth over the cameras that see them."""
    depths = [project(points, projection)[1] for projection in projection_matrices(rig)]
    ratios = [d[d > near] / rig.Ks[camera, 0, 0] for camera, d in enumerate(depths)]
    return float(np.median(np.concatenate(ratios)))


def _n_union(surfaces: list[np.ndarray]) -> int:
    """Different voxels over some frames, at least 1."""
    return max(1, len(np.unique(np.concatenate(surfaces), axis=0)))


def _fuse(surfaces: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Union of the frames' surface voxels [P, 3], sorted, and presence [P, M]."""
    stacked = np.concatenate(surfaces)
    voxels, rows = np.unique(stacked, axis=0, return_inverse=True)
    presence = np.zeros((len(voxels), len(surfaces)), dtype=bool)
    frame_of = np.repeat(np.arange(len(surfaces)), [len(s) for s in surfaces])
    presence[rows.ravel(), frame_of] = True
    return voxels, presence


def _colors(places: Callable[[int], np.ndarray], presence: np.ndarray, seen: _Seen, gains: np.ndarray) -> np.ndarray:
    """Mean over the frames of each point's median colour, 0..1. [P, 3] float32

    Args:
        places: Frame in clip to where the points are. [P, 3]
    """
    sums, counts = np.zeros((len(presence), 3)), np.zeros(len(presence))
    for frame_in_clip in range(presence.shape[1]):
        rows = np.flatnonzero(presence[:, frame_in_clip])
        pixel, is_visible = seen.visibility(places(frame_in_clip)[rows], frame_in_clip)
        colors = hull_colors(seen.pictures(frame_in_clip), pixel, is_visible, gains)
        is_known = np.isfinite(colors[:, 0])
        sums[rows[is_known]] += colors[is_known]
        counts[rows[is_known]] += 1
    average = sums.sum(0) / max(counts.sum(), 1.0)  # for points whose every camera was outvoted
    means = np.where(counts[:, None] > 0, sums / np.maximum(counts, 1.0)[:, None], average)
    return np.clip(means / 255.0, 0.0, 1.0).astype(np.float32)
