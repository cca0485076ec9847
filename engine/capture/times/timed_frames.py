"""Cameras whose frames have times of their own, brought to the moments that all of them show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from engine.capture.files.media import read_frame_times
from engine.capture.frames import FrameSource, IndexedFrames, VideoFrames
from engine.capture.layout.format_result import CameraEntry
from engine.capture.times.clock import common_clock
from engine.errors import CaptureError


def at_common_moments(
    entries: Sequence[CameraEntry],
    frame_times_s: Sequence[np.ndarray | None],
    fps: float | None,
    offsets_frames: Sequence[float],
) -> tuple[list[CameraEntry], int, float, str]:
    """The frames of each camera nearest to the moments of a common clock.

    Args:
        entries: The cameras.
        frame_times_s: When each frame of each was taken. C arrays [T_c]
        fps: As a capture states it; None takes that of the times.
        offsets_frames: How far each camera is ahead, in its own usual frames.
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
                hint="Correct the file of times, or remove it; frames then count as simultaneous.",
                path=entry.source.path,
            )
        times.append(own)
    offsets_s = [offset * usual_period(own) for offset, own in zip(offsets_frames, times, strict=True)]
    clock = common_clock(times, fps=fps, offsets_s=offsets_s, names=[entry.name for entry in entries])
    if clock.is_as_recorded:
        return list(entries), clock.n_frames, clock.fps, clock.note()
    moved = []
    for entry, indices in zip(entries, clock.frame_indices, strict=True):
        masks = None if entry.masks is None else IndexedFrames(entry.masks, indices)
        moved.append(replace(entry, source=IndexedFrames(entry.source, indices), masks=masks))
    return moved, clock.n_frames, clock.fps, clock.note()


def usual_period(times_s: np.ndarray) -> float:
    """Usual distance of two frames, seconds; 0 of a single one."""
    return float(np.median(np.diff(times_s))) if len(times_s) > 1 else 0.0


def own_times(sources: Sequence[FrameSource], is_even: Sequence[bool], fps: float) -> list[np.ndarray] | None:
    """When each frame of each camera is shown, from its first one, where frames cannot be taken one by one.

    Args:
        sources: Frames of all cameras.
        is_even: Whether each camera's frames have the same distance in time and its rate is that of the others.
        fps: Rate of images, and where all is even.
    Returns:
        C arrays [T_c]; None where every camera is even.
    Raises:
        CaptureError: A video has no times.
    """
    if all(is_even):
        return None
    times = []
    for source in sources:
        own = read_frame_times(source.path) if isinstance(source, VideoFrames) else np.arange(source.n_frames) / fps
        times.append(own - own[0])
    return times
