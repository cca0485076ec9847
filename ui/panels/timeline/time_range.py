"""Which frames the timeline shows, and where they lie on the screen. Arithmetic only.

A frame is a cell: frame i lies between i and i + 1, so that n frames reach from 0 to n.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

MIN_SHOWN_FRAMES = 4.0
"""Closer than this nothing more can be seen."""
MARGIN = 0.05
"""Share of what is zoomed to that is left free on either side."""


@dataclass(frozen=True, slots=True)
class TimeRange:
    """Frames from `start` to `stop`, as positions: start < stop."""

    start: float
    stop: float

    @property
    def length(self) -> float:
        """Frames in it."""
        return self.stop - self.start

    def within(self, n_frames: int) -> TimeRange:
        """As much of it as a capture has: not closer than MIN_SHOWN_FRAMES, not wider than the capture."""
        whole = float(max(n_frames, 1))
        length = min(max(self.length, min(MIN_SHOWN_FRAMES, whole)), whole)
        start = min(max(self.start, 0.0), whole - length)
        return TimeRange(start, start + length)

    def zoomed(self, factor: float, at: float, n_frames: int) -> TimeRange:
        """Closer by a factor above 1, farther by one below; what lies `at` stays where it is, as far as that goes."""
        whole = float(max(n_frames, 1))
        length = min(max(self.length / factor, min(MIN_SHOWN_FRAMES, whole)), whole)
        share = (at - self.start) / self.length
        start = at - share * length
        return TimeRange(start, start + length).within(n_frames)

    def panned(self, by_frames: float, n_frames: int) -> TimeRange:
        """Moved, and held inside the capture."""
        return TimeRange(self.start + by_frames, self.stop + by_frames).within(n_frames)

    def showing(self, frame_index: int, n_frames: int) -> TimeRange:
        """Turned over like a page where a frame is not in it; the range itself where it is."""
        if self.start <= frame_index and frame_index + 1 <= self.stop:
            return self
        if frame_index < self.start:
            page = TimeRange(frame_index + 1 - self.length, frame_index + 1)
        else:
            page = TimeRange(frame_index, frame_index + self.length)
        return page.within(n_frames)

    def covers(self, n_frames: int) -> bool:
        """Whether it is all of a capture."""
        return self.length >= n_frames


def whole_range(n_frames: int) -> TimeRange:
    """All frames of a capture."""
    return TimeRange(0.0, float(max(n_frames, 1)))


def range_around(first: int, stop: int, n_frames: int) -> TimeRange:
    """Frames [first, stop) with a little room on either side."""
    room = MARGIN * (stop - first)
    return TimeRange(first - room, stop + room).within(n_frames)


@dataclass(frozen=True, slots=True)
class TimeScale:
    """Where frames lie between two positions of the screen.

    Attributes:
        x0, x1: Left and right end.
        shown: The frames between them.
        n_frames: Of the capture.
        width: From end to end.
        per_frame: Width of one frame's cell.
    """

    x0: float
    x1: float
    shown: TimeRange
    n_frames: int
    width: float = field(init=False)
    per_frame: float = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "width", max(self.x1 - self.x0, 1.0))
        object.__setattr__(self, "per_frame", self.width / self.shown.length)

    def left_of(self, frame_index: float) -> float:
        """Left edge of a frame's cell; may lie outside of the shown part."""
        return self.x0 + (frame_index - self.shown.start) * self.per_frame

    def middle_of(self, frame_index: float) -> float:
        """Middle of a frame's cell."""
        return self.left_of(frame_index + 0.5)

    def position_at(self, x: float) -> float:
        """The position in frames under x."""
        return self.shown.start + (x - self.x0) / self.per_frame

    def frame_at(self, x: float) -> int:
        """The frame whose cell lies under x, held inside of the shown part."""
        if self.n_frames < 1:
            return 0
        first = max(math.floor(self.shown.start), 0)
        last = min(math.ceil(self.shown.stop), self.n_frames) - 1
        return min(max(math.floor(self.position_at(x)), first), last)
