"""Segment: frames of the capture that a take plays in one go."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from msgspec import Meta, Struct

MIN_SPEED, MAX_SPEED = 0.01, 100.0
MAX_FROZEN, MAX_REPEATS = 100_000, 1000
_MIN_RAMP = 1e-9
Ease = Literal["linear", "smooth"]
_Frame = Annotated[int, Meta(ge=0, lt=2**31)]
_Speed = Annotated[float, Meta(ge=MIN_SPEED, le=MAX_SPEED)]
_Share = Annotated[float, Meta(ge=0, le=1)]


class Segment(Struct, frozen=True, forbid_unknown_fields=True):
    """Frames of the capture, one after another or the last one first, perhaps slower, faster, or several times.

    Its speed goes from `start_speed` to `end_speed` while it is played, evenly in time or eased at both ends. All times
    are in output frames, which are as long as frames of the capture and need not be whole: a segment ends where the
    next one begins, between two output frames too.

    Attributes:
        first, stop: First frame of the capture, and the one after the last.
        start_speed, end_speed: Frames of the capture per output frame, MIN_SPEED to MAX_SPEED.
        ease: "linear" or "smooth".
        ramp_from, ramp_to: The share of the way from one speed to the other that the segment has; not 0 and 1 where a
            smooth ramp was split.
        is_reversed: Whether the last frame comes first.
        n_frozen: Output frames for which its only frame is held; 0 where it plays.
        repeats: How often it is played.
        crossfade_frames: Output frames in which the end of one repeat fades into the beginning of the next.

    Raises:
        ValueError: It has no frames, or its entries do not go together.
    """

    first: _Frame
    stop: _Frame
    start_speed: _Speed = 1.0
    end_speed: _Speed = 1.0
    ease: Ease = "linear"
    ramp_from: _Share = 0.0
    ramp_to: _Share = 1.0
    is_reversed: bool = False
    n_frozen: Annotated[int, Meta(ge=0, le=MAX_FROZEN)] = 0
    repeats: Annotated[int, Meta(ge=1, le=MAX_REPEATS)] = 1
    crossfade_frames: Annotated[int, Meta(ge=0, le=MAX_FROZEN)] = 0

    def __post_init__(self) -> None:
        if not 0 <= self.first < self.stop:
            raise ValueError(f"frames {self.first}:{self.stop} are none; the second number has to be higher")
        for speed in (self.start_speed, self.end_speed):
            if not MIN_SPEED <= speed <= MAX_SPEED:  # not a number neither
                raise ValueError(f"a speed of {speed:g} is not between {MIN_SPEED:g} and {MAX_SPEED:g}")
        if not self.ramp_to - self.ramp_from >= _MIN_RAMP:
            raise ValueError(f"a ramp from {self.ramp_from:g} to {self.ramp_to:g} of its way is not valid")
        if not 0 <= self.n_frozen <= MAX_FROZEN:
            raise ValueError(f"{self.n_frozen} frozen frames are not between 1 and {MAX_FROZEN}")
        if not 1 <= self.repeats <= MAX_REPEATS:
            raise ValueError(f"{self.repeats} repeats are not between 1 and {MAX_REPEATS}")
        if self.n_frozen and (self.stop - self.first != 1 or self.repeats != 1):
            raise ValueError("a frozen segment has one frame, and is not repeated")
        if self.crossfade_frames < 0 or (self.crossfade_frames and self.repeats == 1):
            raise ValueError(f"{self.crossfade_frames} frames of cross-fade need at least 2 repeats")
        if self.crossfade_frames * 2 > self.pass_frames + 1e-9:
            raise ValueError(
                f"a cross-fade of {self.crossfade_frames} frames is longer than half of the "
                f"{self.pass_frames:g} frames that are repeated"
            )

    @property
    def n_source(self) -> int:
        """Frames of the capture that it has."""
        return self.stop - self.first

    @property
    def is_plain(self) -> bool:
        """Whether its frames are played once, forward, as fast as they were captured."""
        return self == Segment(self.first, self.stop)

    @property
    def is_simple(self) -> bool:
        """Whether it is neither frozen nor repeated, so that it can be split."""
        return not self.n_frozen and self.repeats == 1

    @property
    def pass_frames(self) -> float:
        """How long it takes to play it once, output frames."""
        if self.n_frozen:
            return float(self.n_frozen)
        eased = float(self._eased(self.ramp_to) - self._eased(self.ramp_from))
        share = eased / (self.ramp_to - self.ramp_from)
        return self.n_source / (self.start_speed + (self.end_speed - self.start_speed) * share)

    @property
    def stride(self) -> float:
        """Output frames from the beginning of a repeat to that of the next one."""
        return self.pass_frames - self.crossfade_frames

    @property
    def output_frames(self) -> float:
        """How long it takes altogether, output frames."""
        return self.pass_frames + (self.repeats - 1) * self.stride

    @property
    def entry(self) -> int:
        """The frame of the capture that it begins with."""
        return self.stop - 1 if self.is_reversed else self.first

    @property
    def exit(self) -> int:
        """The frame of the capture that would come next if it went on; -1 before the first one."""
        if self.n_frozen:
            return self.first
        return self.first - 1 if self.is_reversed else self.stop

    def leads_to(self, other: Segment) -> bool:
        """Whether another segment continues where this one ends, so that nothing jumps between them."""
        return self.exit == other.entry and (self.is_reversed == other.is_reversed or bool(other.n_frozen))

    def advance(self, time: np.ndarray) -> np.ndarray:
        """How many frames of the capture one pass has played. time: Since it began, output frames. [N] to [N]"""
        if self.n_frozen:
            return np.zeros_like(time)
        length = self.pass_frames
        share = np.clip(time / length, 0.0, 1.0)
        start, whole = self.ramp_from, self.ramp_to - self.ramp_from
        eased = (self._eased(start + whole * share) - self._eased(start)) / whole
        return length * (self.start_speed * share + (self.end_speed - self.start_speed) * eased)

    def time_at(self, played: float) -> float:
        """The inverse of `advance`: when so many frames of the capture have been played, output frames."""
        low, high = 0.0, self.pass_frames
        if self.n_frozen or played <= 0:
            return 0.0
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if float(self.advance(np.array(middle))) < played else (low, middle)
        return high

    def speed_at(self, share: float) -> float:
        """The speed after a share of the time of one pass."""
        x = self.ramp_from + (self.ramp_to - self.ramp_from) * share
        eased = x if self.ease == "linear" else x * x * (3 - 2 * x)
        return self.start_speed + (self.end_speed - self.start_speed) * eased

    def _eased(self, x: np.ndarray | float) -> np.ndarray | float:
        """The integral of the way from one speed to the other, from 0 to x."""
        return x * x / 2 if self.ease == "linear" else x * x * x * (1 - x / 2)
