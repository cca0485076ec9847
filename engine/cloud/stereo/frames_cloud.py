"""Everything in one clip as points, what stands still and what moves: multi-view stereo of each frame, then merged.

Every frame is reconstructed from its own pictures alone, and only what cameras agree on becomes points: nothing that
one camera alone saw, and no continued surfaces. The merged cloud keeps all points of the first frame; each later frame
adds a point only where its voxel is still empty.
Letters: C cameras, M frames of the clip, H W full pictures.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from engine.camera.rig import CameraRig
from engine.cloud.background.gains import scene_colors
from engine.cloud.fusion import fuse_tiers, keep_inliers
from engine.cloud.kept_results import Arrays, Keep, do_now
from engine.cloud.stereo.coloring import balance, colored_by_neighbors, observe
from engine.cloud.stereo.depth.changed_depths import changed_depth_maps
from engine.cloud.stereo.depth.depth_maps import estimate_depth_maps
from engine.cloud.stereo.depth.depth_scene import DepthMaps
from engine.cloud.stereo.sampling import median_footprint, sample_tiers, seen_pixels, working_pictures
from engine.cloud.voxel import voxel_keys, voxel_means
from engine.errors import PreparationError

logger = logging.getLogger(__name__)

Report = Callable[[str], None]

FRAME_SPACING_PX = 4.0
"""Voxel edge in full-size pixels at the median depth, unless max_points asks for coarser ones."""
MIN_LIMIT = 8
"""Points that remain however large a voxel is: the corners of eight meet in the origin."""


@dataclass(frozen=True, slots=True)
class FramesCloud:
    """Points of all frames of a clip.

    Attributes:
        points: [P, 3] float32, scene units; those that the first frame added come first, then the second's, and so on.
        colors: White-balanced (median camera) display colour in 0..1, as in the frame that added the point. [P, 3]
            float32
        gains: camera_colour = gain * scene_colour. [C, 3] float32, median 1; all 1 where cameras do not differ.
        spacing: Voxel edge, scene units.
        n_of_frames: Points that each frame added. [M] int64
    """

    points: np.ndarray
    colors: np.ndarray
    gains: np.ndarray
    spacing: float
    n_of_frames: np.ndarray


def build_frames_cloud(
    frames: Callable[[int, int], np.ndarray],
    n_frames: int,
    rig: CameraRig,
    *,
    valid_in: Callable[[int], np.ndarray | None] = lambda frame_in_clip: None,
    max_points: int,
    spacing: float | None = None,
    find_sparse: Callable[[np.ndarray, np.ndarray | None], np.ndarray] | None = None,
    gains: np.ndarray | None = None,
    color: str = "auto",
    report: Report,
    keep: Keep = do_now,
) -> FramesCloud:
    """Multi-view stereo of every frame of a clip, merged on one voxel grid.

    Args:
        frames: (row of the rig, frame_in_clip) -> picture [H, W, 3] uint8. Called in order from this thread.
        n_frames: M.
        rig: Training cameras only, at the size of the pictures.
        valid_in: Frame in clip to the pixels that count there; None for all. [C, H, W] bool
        max_points: The voxel grows until no more than this many points remain; at least 8.
        spacing: Voxel edge to use as it is, scene units, whatever max_points says; a source clip takes its
            reference's. None derives it.
        find_sparse: Pictures of the first frame [C, H, W, 3] and the pixels that count in them (or None) ->
            triangulated points [P, 3], which set the depth ranges.
        gains: Of a source clip, those of its reference. [C, 3]; None measures them in the first frame.
        color: How to measure them. "auto": gains where the cameras differ by more than the estimate errs. "gain":
            always. "off": never.
        report: Gets one line per frame and step, with counts and the reason.
        keep: Keeps what took long, under names that belong to these arguments alone.
    Raises:
        PreparationError: Fewer than 2 cameras, no frame, or nothing that two cameras agree on in any of them.
        ValueError: max_points is below 8.
    """
    if len(rig) < 2:
        raise PreparationError(f"{len(rig)} camera cannot give depth; at least 2 training cameras are needed.")
    if n_frames < 1:
        raise PreparationError("A clip without frames has no point cloud.")
    if max_points < MIN_LIMIT:
        raise ValueError(f"max_points is {max_points}, has to be at least {MIN_LIMIT}")
    stereo = _FrameStereo(frames, valid_in, rig, find_sparse, gains, color, report, keep)
    clouds = [stereo.cloud(frame_in_clip, spacing) for frame_in_clip in range(n_frames)]
    started = time.perf_counter()
    frame_of = np.repeat(np.arange(n_frames), [len(points) for points, _ in clouds])
    points, colors = (np.concatenate(parts) for parts in zip(*clouds, strict=True))
    if len(points) == 0:
        raise PreparationError("No surface was found in any frame: no pixel is agreed on by 2 cameras.")
    asked = size = spacing or stereo.fine_spacing
    merged, merged_colors, n_of_frames = merged_frames(points, colors, frame_of, n_frames, size)
    while spacing is None and len(merged) > max_points:
        size *= 1.02 * float(np.sqrt(len(merged) / max_points))  # surface points fall with the spacing squared
        merged, merged_colors, n_of_frames = merged_frames(points, colors, frame_of, n_frames, size)
    limit = "as given" if spacing else f"asked {asked:.4g} = {FRAME_SPACING_PX:g} px, limit {max_points}"
    added = n_of_frames[1:].mean() if n_frames > 1 else 0
    report(f"Frames merged: {len(merged):,} points, of which each frame after the first adds {added:,.0f}")
    logger.info(
        "frames merged at %.4g scene units (%s): %d of the first frame, of %.0f found in each; %.1f s",
        *(size, limit, n_of_frames[0], len(points) / n_frames, time.perf_counter() - started),
    )
    return FramesCloud(
        points=merged.astype(np.float32),
        colors=np.clip(merged_colors / 255.0, 0.0, 1.0).astype(np.float32),
        gains=stereo.gains.astype(np.float32),
        spacing=float(size),
        n_of_frames=n_of_frames,
    )


def merged_frames(
    points: np.ndarray, colors: np.ndarray, frame_of: np.ndarray, n_frames: int, size: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One point per voxel: the mean of those that the first frame with any point in that voxel has there.

    Args:
        points, colors: Of all frames. [P, 3]
        frame_of: Rising. [P] int
        size: Voxel edge, scene units. The cells lie on multiples of it, so that clips share them.
    Returns:
        points [Q, 3], colors [Q, 3], both frame by frame, and points that each frame added [M] int64.
    """
    _, first, voxel = np.unique(voxel_keys(points, size), return_index=True, return_inverse=True)
    is_first = frame_of == frame_of[first[voxel]]
    rows = np.flatnonzero(is_first)
    merged, (merged_colors, frame), _ = voxel_means(
        points[rows], size, [colors[rows], frame_of[rows, None]], np.ones(len(rows))
    )
    frame = frame[:, 0].round().astype(np.int64)
    order = np.argsort(frame, kind="stable")
    return merged[order], merged_colors[order], np.bincount(frame, minlength=n_frames)


class _FrameStereo:
    """Points of one frame after another.

    Attributes:
        fine_spacing: Distance between a frame's points as they are found, scene units. Known after the first frame.
        gains: [C, 3]; all 1 until the first frame with points, unless they were given.
    """

    def __init__(
        self,
        frames: Callable[[int, int], np.ndarray],
        valid_in: Callable[[int], np.ndarray | None],
        rig: CameraRig,
        find_sparse: Callable[[np.ndarray, np.ndarray | None], np.ndarray] | None,
        gains: np.ndarray | None,
        color: str,
        report: Report,
        keep: Keep,
    ) -> None:
        self._frames, self._valid_in, self._rig, self._find_sparse = frames, valid_in, rig, find_sparse
        self._color, self._report = color, report
        self._keep: Keep = lambda name, work: keep(f"frames: {name}", work)
        self._has_gains = gains is not None
        self.gains = np.ones((len(rig), 3)) if gains is None else np.asarray(gains, dtype=np.float64)
        self.fine_spacing = 0.0
        self._first: DepthMaps | None = None

    def cloud(self, frame_in_clip: int, spacing: float | None) -> tuple[np.ndarray, np.ndarray]:
        """Points [P, 3] and colours [P, 3] 0..255 of one frame, float64. Frames have to come in order.

        Args:
            spacing: The spacing at which the frames will be merged, if known.
        """
        started = time.perf_counter()
        found = self._keep(f"points of frame {frame_in_clip}", lambda: self._find(frame_in_clip, spacing))
        self.fine_spacing = float(found["fine_spacing"])
        if not self._has_gains:
            self.gains, self._has_gains = found["gains"], bool(len(found["points"]))
        self._report(f"Frame {frame_in_clip}: {len(found['points']):,} points that cameras agree on")
        logger.info("frame %d took %.1f s", frame_in_clip, time.perf_counter() - started)
        return found["points"], found["colors"]

    def _find(self, frame_in_clip: int, spacing: float | None) -> Arrays:
        """The data kept of a frame: its points and colours, and the spacing and the gains that they have."""
        pictures, is_stable, is_valid = self._pictures(frame_in_clip)
        maps, is_new = self._maps(frame_in_clip, pictures, is_stable)
        width = int(maps.rig.image_sizes[0, 0])
        if not self.fine_spacing:
            self.fine_spacing = FRAME_SPACING_PX * median_footprint(maps) * width / self._rig.image_sizes[0, 0]
            self.fine_spacing = min(self.fine_spacing, spacing or np.inf)
        samples = working_pictures(pictures, width) / maps.scene.gains[:, None, None]
        tiers = sample_tiers(maps, samples, is_seen=seen_pixels(is_valid, width), is_wanted=is_new)[:2]
        points, _, colors = fuse_tiers(tiers, self.fine_spacing)
        is_kept = keep_inliers(points)
        points, colors = points[is_kept], colors[is_kept]
        log_colors = observe(points, pictures, is_stable, self._rig, maps)
        gains = self.gains
        if not self._has_gains and len(points):
            gains, seen_colors, decision = balance(points, log_colors, maps.scene.gains, self._color)
            self._report(f"White balance: {decision}")
        else:
            seen_colors = scene_colors(log_colors, gains)
        return {
            "points": points,
            "colors": colored_by_neighbors(points, colors, seen_colors),
            "gains": np.asarray(gains, dtype=np.float64),
            "fine_spacing": np.array(self.fine_spacing),
        }

    def _maps(self, frame_in_clip: int, pictures: np.ndarray, is_stable: np.ndarray) -> tuple[DepthMaps, np.ndarray]:
        """Depth maps of a frame, and the pixels [C, h, w] whose points those of the first frame do not have yet."""
        if self._first is None:
            first = (pictures, is_stable) if frame_in_clip == 0 else self._pictures(0)[:2]
            self._first = self._first_maps(*first)
        if frame_in_clip == 0:
            return self._first, np.ones_like(self._first.is_agreed)
        return changed_depth_maps(pictures, is_stable, self._rig, self._first)

    def _first_maps(self, pictures: np.ndarray, is_stable: np.ndarray) -> DepthMaps:
        sparse_points = None
        if self._find_sparse is not None:
            find, is_valid = self._find_sparse, self._valid_in(0)
            sparse_points = self._keep("sparse points", lambda: {"points": find(pictures, is_valid)})["points"]
        return estimate_depth_maps(
            pictures,
            is_stable,
            self._rig,
            sparse_points=sparse_points if sparse_points is not None and len(sparse_points) else None,
            report=self._report,
            keep=self._keep,
        )[1]

    def _pictures(self, frame_in_clip: int) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Pictures of a frame [C, H, W, 3], pixels that count in them [C, H, W] bool, and the same or None for all."""
        pictures = np.stack([self._frames(row, frame_in_clip) for row in range(len(self._rig))])
        is_valid = self._valid_in(frame_in_clip)
        return pictures, np.ones(pictures.shape[:3], dtype=bool) if is_valid is None else is_valid, is_valid
