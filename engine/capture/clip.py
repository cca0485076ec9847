"""Clips: N frames cut into runs of M. The only place that converts between frame and clip time."""

from __future__ import annotations

import itertools
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Clip:
    """Frames [start, start + n_frames) of a capture.

    Attributes:
        clip_index: Position in the capture, from 0.
        start: First frame_index.
        n_frames: Frames in this clip; one that was split, or the last one, may be shorter than clip_length.
        clip_length: M, the divisor of clip_time: that of the project for every clip, partial ones too, and n_frames
            for a clip that was merged to more than that.
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


def cut_clips(bounds: Sequence[int], clip_length: int) -> list[Clip]:
    """Clips between bounds: the first frame of each, and at the end the number of frames.

    Args:
        bounds: Rise from 0.
        clip_length: M of every clip that is not longer.
    """
    pairs = enumerate(itertools.pairwise(bounds))
    return [Clip(i, start, stop - start, max(clip_length, stop - start)) for i, (start, stop) in pairs]


class ClipSpans:
    """Finds the clip of a frame among clips of any lengths.

    Args:
        clips: Of a whole capture, in order, without gaps.

    Attributes:
        usual_length: Frames of the clip in the middle, by length.
    """

    def __init__(self, clips: Sequence[Clip]) -> None:
        self._starts = [clip.start for clip in clips]
        lengths = sorted(clip.n_frames for clip in clips)
        self.usual_length = lengths[len(lengths) // 2] if lengths else 1

    def index_of(self, frame_index: int) -> int:
        """Index of the clip that holds a frame; the first or last one for frames outside. There has to be a clip."""
        return min(max(bisect_right(self._starts, frame_index) - 1, 0), len(self._starts) - 1)
