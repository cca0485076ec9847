"""Markers: frames that the user wants to find again, to be looked up by frame. The document holds them."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence

from app.document.project_document import Marker


class Markers:
    """The markers of one capture, one a frame. items: In any order."""

    def __init__(self, items: Sequence[Marker] = ()) -> None:
        self._items = sorted(items, key=_frame_of)

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
        is_there = place < len(self._items) and self._items[place].frame_index == frame_index
        return self._items[place] if is_there else None

    def between(self, first: float, stop: float) -> list[Marker]:
        """Markers in [first, stop)."""
        return self._items[self._place(first) : self._place(stop)]

    def after(self, frame_index: int) -> Marker | None:
        """The first marker behind a frame."""
        place = bisect_right(self._items, frame_index, key=_frame_of)
        return self._items[place] if place < len(self._items) else None

    def before(self, frame_index: int) -> Marker | None:
        """The last marker in front of a frame."""
        place = self._place(frame_index)
        return self._items[place - 1] if place else None

    def _place(self, frame_index: float) -> int:
        return bisect_left(self._items, frame_index, key=_frame_of)


def _frame_of(marker: Marker) -> int:
    return marker.frame_index
