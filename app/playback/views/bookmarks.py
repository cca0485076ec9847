"""Bookmarks: views of a project that the user has named, to come back to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from app.playback.views.view_place import ViewPlace

MAX_BOOKMARKS = 200
MAX_NAME_CHARACTERS = 200
NUMBERS = range(1, 10)
"""Bookmarks with a number have a key."""


@dataclass(frozen=True, slots=True)
class Bookmark:
    """One view.

    Attributes:
        name: As the user wrote it.
        place: From where and through which lens.
        number: One of NUMBERS, each at most once; None without.
        frame_index: The frame that belongs to it; None leaves time alone.
    """

    name: str
    place: ViewPlace
    number: int | None = None
    frame_index: int | None = None


class Bookmarks:
    """Those of one project, in the order in which they were made."""

    def __init__(self, items: tuple[Bookmark, ...] = ()) -> None:
        self.items = items[:MAX_BOOKMARKS]

    def numbered(self, number: int) -> Bookmark | None:
        """The bookmark with a number; None without one."""
        return next((item for item in self.items if item.number == number), None)

    def add(self, name: str, place: ViewPlace, frame_index: int | None = None) -> Bookmark | None:
        """Keep a view under a name, with the lowest number that is free. A name that is taken means the new view.

        Returns:
            The bookmark; None where there is no room for more.
        """
        name = name.strip()[:MAX_NAME_CHARACTERS]
        same = next((item for item in self.items if item.name == name), None)
        if same is not None:
            return self._replace(same, Bookmark(name, place, same.number, frame_index))
        taken = {item.number for item in self.items}
        number = next((number for number in NUMBERS if number not in taken), None)
        if len(self.items) >= MAX_BOOKMARKS:
            return None
        item = Bookmark(name or self._free_name(number), place, number, frame_index)
        self.items = (*self.items, item)
        return item

    def set_numbered(self, number: int, place: ViewPlace, frame_index: int | None = None) -> Bookmark | None:
        """Keep a view under a number; one that has it already keeps its name and means the new view."""
        old = self.numbered(number)
        if old is not None:
            return self._replace(old, Bookmark(old.name, place, number, frame_index))
        if number not in NUMBERS or len(self.items) >= MAX_BOOKMARKS:
            return None
        item = Bookmark(self._free_name(number), place, number, frame_index)
        self.items = (*self.items, item)
        return item

    def remove(self, index: int) -> None:
        """Forget the bookmark at a position; a position that is not there changes nothing."""
        self.items = tuple(item for i, item in enumerate(self.items) if i != index)

    def _replace(self, old: Bookmark, new: Bookmark) -> Bookmark:
        self.items = tuple(new if item is old else item for item in self.items)
        return new

    def _free_name(self, number: int | None) -> str:
        names = {item.name for item in self.items}
        wanted = len(self.items) + 1 if number is None else number
        while f"View {wanted}" in names:
            wanted += 1
        return f"View {wanted}"

    def values(self) -> list[dict[str, Any]]:
        """All bookmarks as values for JSON."""
        return [
            {"name": item.name, "number": item.number, "frame_index": item.frame_index, **item.place.values()}
            for item in self.items
        ]


def read_bookmarks(values: Any) -> Bookmarks:
    """Bookmarks from the result of `Bookmarks.values`; entries that are not valid are left out."""
    items: list[Bookmark] = []
    for value in values if isinstance(values, list) else []:
        place = ViewPlace.read(value) if isinstance(value, dict) else None
        if place is None or not isinstance(value.get("name"), str) or not value["name"].strip():
            continue
        number, frame_index = value.get("number"), value.get("frame_index")
        is_free = _is_count(number) and number in NUMBERS and all(item.number != number for item in items)
        items.append(
            Bookmark(
                value["name"][:MAX_NAME_CHARACTERS],
                place,
                number if is_free else None,
                frame_index if _is_count(frame_index) else None,
            )
        )
    return Bookmarks(tuple(items))


def _is_count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**31
