"""Markers: frames that the user wants to find again, each with a name. Rising frames, one marker a frame."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field

MAX_MARKERS = 1000
"""More are not taken: a list that long is no longer for finding anything."""
MAX_NAME_CHARACTERS = 120


@dataclass(frozen=True, slots=True)
class Marker:
    """One marked frame.

    Attributes:
        name: As the user has written it; may be empty, and may hold any character.
    """

    frame_index: int
    name: str = ""


@dataclass
class Markers:
    """The markers of one capture, kept in the order of their frames."""

    _items: list[Marker] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self._items)

    def __iter__(self) -> Iterator[Marker]:
        return iter(self._items)

    def __bool__(self) -> bool:
        return bool(self._items)

    @property
    def frames(self) -> list[int]:
        """Frames that have a marker, rising."""
        return [marker.frame_index for marker in self._items]

    def at(self, frame_index: int) -> Marker | None:
        """The marker of a frame."""
        place = self._place(frame_index)
        return self._items[place] if self._has(place, frame_index) else None

    def between(self, first: float, stop: float) -> list[Marker]:
        """Markers in [first, stop)."""
        return self._items[self._place(first) : self._place(stop)]

    def put(self, frame_index: int, name: str = "") -> bool:
        """Mark a frame, or give its marker another name. Whether there was room for it."""
        place = self._place(frame_index)
        marker = Marker(int(frame_index), name[:MAX_NAME_CHARACTERS])
        if self._has(place, frame_index):
            self._items[place] = marker
        elif len(self._items) < MAX_MARKERS:
            self._items.insert(place, marker)
        else:
            return False
        return True

    def remove(self, frame_index: int) -> None:
        """Forget the marker of a frame, if it has one."""
        place = self._place(frame_index)
        if self._has(place, frame_index):
            del self._items[place]

    def after(self, frame_index: int) -> Marker | None:
        """The first marker behind a frame."""
        place = bisect_right(self._items, frame_index, key=_frame_of)
        return self._items[place] if place < len(self._items) else None

    def before(self, frame_index: int) -> Marker | None:
        """The last marker in front of a frame."""
        place = self._place(frame_index)
        return self._items[place - 1] if place else None

    def keep_below(self, n_frames: int) -> None:
        """Forget what lies outside a capture of so many frames."""
        self._items = self.between(0, n_frames)

    def _place(self, frame_index: float) -> int:
        return bisect_left(self._items, frame_index, key=_frame_of)

    def _has(self, place: int, frame_index: int) -> bool:
        return place < len(self._items) and self._items[place].frame_index == frame_index


def _frame_of(marker: Marker) -> int:
    return marker.frame_index
