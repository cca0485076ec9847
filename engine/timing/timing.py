"""TakeTiming: which moments of the capture a take shows, output frame by output frame."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from msgspec import structs

from engine.timing.segment import Segment

MAX_SEGMENTS = 1000
MAX_OUTPUT_FRAMES = 1_000_000
_SNAP = 1e-6
"""Moments as near as this to a frame are that frame: what adding up times leaves of rounding."""


@dataclass(frozen=True, slots=True)
class SourceMoment:
    """A moment of the capture, and how much of it is seen.

    Attributes:
        frame: In frames of the capture, between frames too.
        weight: All weights of a moment of the take add up to 1.
    """

    frame: float
    weight: float = 1.0


@dataclass(frozen=True)
class TakeTiming:
    """The timing of a take.

    Attributes:
        segments: In output order; none for the take as captured. What lies outside of the capture is left out.
        n_frames: Of the capture, at least 1.
    """

    segments: tuple[Segment, ...]
    n_frames: int

    @cached_property
    def played(self) -> tuple[Segment, ...]:
        """The segments that are in the capture, as far as they are; the whole capture where that is none."""
        inside = (one for one in self.segments if one.first < self.n_frames)
        found = [_ending_at(one, self.n_frames) for one in inside]
        return tuple(found) or (Segment(0, self.n_frames),)

    @cached_property
    def starts(self) -> np.ndarray:
        """Output frame at which each of the played segments begins, and at the end that of the end. [S + 1] float64"""
        return np.concatenate([[0.0], np.cumsum([one.output_frames for one in self.played])])

    @property
    def n_output(self) -> int:
        """Number of output frames, at least 1."""
        return max(math.ceil(float(self.starts[-1]) - _SNAP), 1)

    @property
    def is_as_captured(self) -> bool:
        """Whether every output frame is the frame of the capture of the same number."""
        ends = np.cumsum([one.n_source for one in self.played])
        in_order = all(one.is_plain and one.stop == end for one, end in zip(self.played, ends, strict=True))
        return in_order and int(ends[-1]) == self.n_frames

    def duration_s(self, fps: float) -> float:
        """How long the take is, seconds. fps: Of the capture."""
        return self.n_output / fps

    def source_at(self, output: float) -> tuple[SourceMoment, ...]:
        """The moments of the capture that are seen at a moment of the take: one, or two where a loop fades.

        Args:
            output: In output frames, between frames too; held inside the take.
        """
        frames, weights = self.moments(np.array([output]))
        found = zip(frames[:, 0].tolist(), weights[:, 0].tolist(), strict=True)
        return tuple(SourceMoment(frame, weight) for frame, weight in found if weight > 0)

    def moments(self, outputs: np.ndarray, *, is_sound: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """The same for many moments at once.

        Args:
            outputs: In output frames. [N]
            is_sound: For sound, which goes on during the last frame of a segment; pictures stand still there.
        Returns:
            Frames of the capture and weights of the two moments seen at each of them; the second weight is 0 where
            nothing fades. [2, N] float64 each
        """
        outputs = np.clip(np.asarray(outputs, np.float64), 0.0, max(float(self.starts[-1]), self.n_output - 1.0))
        places = np.searchsorted(self.starts[:-1], outputs + _SNAP, side="right") - 1
        frames, weights = np.zeros((2, len(outputs))), np.zeros((2, len(outputs)))
        for place in np.unique(places).tolist():
            here = places == place
            frames[:, here], weights[:, here] = self._of_segment(
                place, outputs[here] - float(self.starts[place]), is_sound=is_sound
            )
        return frames, weights

    def _of_segment(self, place: int, time: np.ndarray, *, is_sound: bool) -> tuple[np.ndarray, np.ndarray]:
        """Moments and weights as of `moments`. time: Since the segment began. [N]"""
        one = self.played[place]
        time = np.maximum(time, 0.0)
        repeat = np.clip(np.floor((time + _SNAP) / one.stride), 0, one.repeats - 1)
        time = np.maximum(time - repeat * one.stride, 0.0)
        is_fading = (repeat > 0) & (time < one.crossfade_frames - _SNAP)
        new = np.where(is_fading, (time + 1.0) / (one.crossfade_frames + 1.0), 1.0)
        goes_on = place + 1 < len(self.played) and one.leads_to(self.played[place + 1])
        now = self._frames(one, time, ((repeat == one.repeats - 1) & goes_on) | is_sound)
        before = self._frames(one, time + one.stride, np.full_like(is_fading, is_sound))
        return np.stack([now, np.where(is_fading, before, now)]), np.stack([new, 1.0 - new])

    def _frames(self, one: Segment, time: np.ndarray, goes_on: np.ndarray) -> np.ndarray:
        """Frames of the capture after some time of a pass. goes_on: Whether it may pass its last frame. [N]"""
        played = np.minimum(one.advance(time), np.where(goes_on, one.n_source, one.n_source - 1))
        frames = one.stop - 1 - played if one.is_reversed else one.first + played
        nearest = np.round(frames)
        return np.clip(np.where(np.abs(frames - nearest) < _SNAP, nearest, frames), 0, self.n_frames - 1 + goes_on)

    def outputs_of(self, frame: float) -> list[float]:
        """When a moment of the capture is seen: moments of the take, rising; none where it was cut out."""
        found: list[float] = []
        for start, one in zip(self.starts[:-1].tolist(), self.played, strict=True):
            played = one.stop - 1 - frame if one.is_reversed else frame - one.first
            if 0 <= played <= one.n_source - 1:
                since = one.time_at(played)
                found += [start + since + repeat * one.stride for repeat in range(one.repeats)]
        return found


def nearest_frames(timing: TakeTiming) -> np.ndarray:
    """The frame of the capture nearest to every output frame, of a cross-fade the heavier one. [n_output] int64"""
    frames, weights = timing.moments(np.arange(timing.n_output))
    shown = np.where(weights[1] > weights[0], frames[1], frames[0])
    return np.ceil(shown - 0.5).astype(np.int64)


def check_length(segments: Sequence[Segment]) -> None:
    """Check that a take can be of so many segments, and as long as they are.

    Raises:
        ValueError: It would be too long.
    """
    if len(segments) > MAX_SEGMENTS:
        raise ValueError(f"{len(segments)} segments are more than {MAX_SEGMENTS}")
    length = sum(one.output_frames for one in segments)
    if length > MAX_OUTPUT_FRAMES:
        raise ValueError(f"the take would have {length:,.0f} frames; at most {MAX_OUTPUT_FRAMES:,} can be")


def _ending_at(one: Segment, n_frames: int) -> Segment:
    if one.stop <= n_frames:
        return one
    cut = structs.replace(one, stop=n_frames, crossfade_frames=0)
    fade = min(one.crossfade_frames, math.floor(cut.pass_frames / 2))
    return structs.replace(cut, crossfade_frames=fade)
