"""Cameras whose frames have times of their own, brought to the moments that all of them show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from engine.capture.clock import common_clock
from engine.capture.format_result import CameraEntry
from engine.capture.frames import IndexedFrames
from engine.errors import CaptureError


def at_common_moments(
    entries: Sequence[CameraEntry], frame_times_s: Sequence[np.ndarray | None], fps: float | None
) -> tuple[list[CameraEntry], int, float, str]:
    """The frames of each camera nearest to the moments of a common clock.

    Args:
        entries: The cameras.
        frame_times_s: When each frame of each was taken. C arrays [T_c]
        fps: As a capture states it; None takes that of the times.
    Returns:
        The cameras, how many moments there are, how many per second, and what was made of the recordings.
    Raises:
        CaptureError: A camera has no times, or as many as it has no frames; or they have no moment in common.
    """
    times: list[np.ndarray] = []
    for entry, own in zip(entries, frame_times_s, strict=True):
        n_times = 0 if own is None else len(own)
        if own is None or n_times != entry.source.n_frames:
            raise CaptureError(
                f'Camera "{entry.name}" has {entry.source.n_frames} frames, but times of {n_times}.',
                hint="Correct the file of times, or take it away: frames then count as taken together.",
                path=entry.source.path,
            )
        times.append(own)
    clock = common_clock(times, fps=fps, names=[entry.name for entry in entries])
    if clock.is_as_recorded:
        return list(entries), clock.n_frames, clock.fps, clock.note()
    moved = []
    for entry, indices in zip(entries, clock.frame_indices, strict=True):
        masks = None if entry.masks is None else IndexedFrames(entry.masks, indices)
        moved.append(replace(entry, source=IndexedFrames(entry.source, indices), masks=masks))
    return moved, clock.n_frames, clock.fps, clock.note()
