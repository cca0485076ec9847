"""Clips: N frames cut into runs of M. The only place that converts between frame and clip time."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Clip:
    """Frames [start, start + n_frames) of a capture.

    Attributes:
        clip_index: Position in the capture, from 0.
        start: First frame_index.
        n_frames: Frames in this clip; the last clip may be shorter than clip_length.
        clip_length: M, the divisor of clip_time for every clip, partial ones too.
    """

    clip_index: int
    start: int
    n_frames: int
    clip_length: int

    @property
    def stop(self) -> int:
        """One past the last frame_index."""
        return self.start + self.n_frames

    def frame_indices(self) -> range:
        """Capture frame indices of this clip."""
        return range(self.start, self.stop)

    def clip_time(self, frame_index: int) -> float:
        """frame_in_clip / clip_length, in [0, 1). Raises ValueError for a frame outside the clip."""
        if not self.start <= frame_index < self.stop:
            raise ValueError(f"frame {frame_index} is outside clip {self.clip_index} [{self.start}, {self.stop})")
        return (frame_index - self.start) / self.clip_length


def split_clips(n_frames: int, clip_length: int) -> list[Clip]:
    """Cut n_frames into clips of clip_length; the last one keeps the remainder.

    Raises:
        ValueError: n_frames or clip_length is below 1.
    """
    if n_frames < 1 or clip_length < 1:
        raise ValueError(f"n_frames and clip_length must be at least 1, got {n_frames} and {clip_length}")
    starts = range(0, n_frames, clip_length)
    return [Clip(i, start, min(clip_length, n_frames - start), clip_length) for i, start in enumerate(starts)]
