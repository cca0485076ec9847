"""NumberedFiles: the images of a camera by their numbers, those that do not exist yet included.

In a capture that is still being recorded, frames count by the numbers in the names of their files: what is late or lost
leaves a gap, and nothing behind it moves up.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise, zip_longest
from pathlib import Path
from typing import overload

from engine.errors import CaptureError
from engine.text import shown

_NUMBER = re.compile(r"(\d+)")
MAX_GAP = 1_000_000
"""Frames between the first and the last file of a camera; a larger gap is the time of day rather than a number."""


class NumberedFiles(Sequence[Path]):
    """Paths of frames [0, n), made of their numbers when they are asked for.

    Args:
        folder: Where they lie; names are relative to it.
        parts: The name of one of them, cut into texts and numbers in turn.
        rows: Which of the parts are the number of the frame.
        first: Number of frame 0.
        n_frames: How many there are, or may be.
        seen: One that exists.

    Attributes:
        folder, seen, first: Likewise.
    """

    def __init__(
        self, folder: Path, parts: Sequence[str], rows: Sequence[int], *, first: int, n_frames: int, seen: Path
    ) -> None:
        self.folder, self.seen, self.first = folder, seen, first
        self._parts, self._rows, self._n_frames = tuple(parts), tuple(rows), n_frames

    def __len__(self) -> int:
        return self._n_frames

    @overload
    def __getitem__(self, index: int) -> Path: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Path]: ...
    def __getitem__(self, index: int | slice) -> Path | Sequence[Path]:
        if isinstance(index, slice):
            return [self[row] for row in range(*index.indices(self._n_frames))]
        if not -self._n_frames <= index < self._n_frames:
            raise IndexError(f"frame {index} is outside 0..{self._n_frames - 1}")
        return self.file(index % self._n_frames)

    def file(self, frame_index: int) -> Path:
        """The file of a frame, whether it is among these or may come later."""
        parts = list(self._parts)
        for row in self._rows:
            parts[row] = f"{self.first + frame_index:0{len(parts[row])}d}"
        return self.folder / "".join(parts)

    def stretched(self, n_frames: int, first: int | None = None) -> NumberedFiles:
        """The same of another length; first: and counted from another number."""
        first = self.first if first is None else first
        return NumberedFiles(self.folder, self._parts, self._rows, first=first, n_frames=n_frames, seen=self.seen)


def numbered_files(files: Sequence[Path], folder: Path) -> NumberedFiles:
    """The files of one camera by the numbers in their names, from the first to the last that exists.

    Args:
        files: At least two, in order.
        folder: That of the capture.
    Raises:
        CaptureError: They are not numbered one after the other.
    """
    if len(files) < 2:
        found = "one frame" if files else "no frame"
        text = f"It has {found} so far; two show how they are numbered."
        raise CaptureError(text, hint="Wait for more.", path=folder)
    names = [str(file.relative_to(folder)) for file in files]
    split = [_NUMBER.split(name) for name in names]
    rows = [row for row, (one, other) in enumerate(zip_longest(split[0], split[1])) if one != other]
    template = min(split, key=lambda parts: sum(map(len, parts)))  # 9 and 10, without leading zeros: one digit
    numbers = []
    for parts in split:
        others = [part for row, part in enumerate(parts) if row not in rows]
        found = {int(parts[row]) for row in rows} if _are_numbers(parts, rows) else set()
        if len(found) != 1 or others != [part for row, part in enumerate(template) if row not in rows]:
            raise _not_numbered(names, "".join(parts), folder)
        numbers.append(found.pop())
    steps = [after - before for before, after in pairwise(numbers)]
    if min(steps) < 1 or max(steps) > MAX_GAP or (len(steps) > 1 and min(steps) > 1):
        raise _not_numbered(names, names[steps.index(max(steps)) + 1], folder)
    n_frames = numbers[-1] - numbers[0] + 1
    return NumberedFiles(folder, template, rows, first=numbers[0], n_frames=n_frames, seen=files[0])


def alike(files: Sequence[NumberedFiles]) -> list[NumberedFiles]:
    """Files of all cameras, counted from the lowest number of all: a camera whose first frames are late lacks them."""
    first = min(one.first for one in files)
    return [one.stretched(one.first - first + len(one), first) for one in files]


def _are_numbers(parts: Sequence[str], rows: Sequence[int]) -> bool:
    return bool(rows) and all(row < len(parts) and row % 2 == 1 and len(parts[row]) <= 18 for row in rows)


def _not_numbered(names: Sequence[str], odd: str, folder: Path) -> CaptureError:
    return CaptureError(
        f"Its images {shown(names[0])}, {shown(names[1])} and {shown(odd)} are not numbered one after the other.",
        hint="A capture that is still being recorded needs frame numbers in the names of its images.",
        path=folder,
    )
