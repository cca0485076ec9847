"""A calibration board: what is printed on it and how large it is, as one line of text."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from engine.errors import CaptureError
from engine.text import shown

EXAMPLE = "charuco:7x5:0.04:0.03"
DEFAULT_DICTIONARY = "4X4_50"
MAX_SQUARES = 100
"""Along one side."""
MAX_METRES = 10.0
"""Of the side of one square."""
HOW = (
    f"Write charuco:COLUMNSxROWS:SQUARE:MARKER[:DICTIONARY], squares and lengths in metres, such as {EXAMPLE}, or "
    "chessboard:COLUMNSxROWS:SQUARE, inner corners, such as chessboard:9x6:0.03."
)


@dataclass(frozen=True, slots=True)
class Board:
    """What a board is. A value.

    Attributes:
        columns, rows: Squares of a ChArUco board; inner corners of a chessboard.
        square_m: Side of a square.
        marker_m: Side of a marker; 0 for a chessboard.
        dictionary: Of the markers, such as "4X4_50"; empty for a chessboard.
    """

    columns: int
    rows: int
    square_m: float
    marker_m: float = 0.0
    dictionary: str = ""

    @property
    def is_charuco(self) -> bool:
        """Whether it has markers."""
        return bool(self.dictionary)

    @property
    def corners(self) -> np.ndarray:
        """Inner corners, row after row: x to the right, y down as it is looked at, so z points away from whoever looks.
        m. [K, 3]"""
        n_columns, n_rows = (self.columns - 1, self.rows - 1) if self.is_charuco else (self.columns, self.rows)
        x, y = np.meshgrid(np.arange(n_columns) + 1.0, np.arange(n_rows) + 1.0)
        return np.stack([x.reshape(-1), y.reshape(-1), np.zeros(x.size)], axis=-1) * self.square_m

    @property
    def text(self) -> str:
        """As `read_board` reads it."""
        if not self.is_charuco:
            return f"chessboard:{self.columns}x{self.rows}:{self.square_m:g}"
        return f"charuco:{self.columns}x{self.rows}:{self.square_m:g}:{self.marker_m:g}:{self.dictionary}"


def dictionaries() -> dict[str, int]:
    """OpenCV's numbers of the known dictionaries of markers, by name without "DICT_"."""
    import cv2

    names = [name for name in dir(cv2.aruco) if name.startswith("DICT_") and name == name.upper()]
    return {name.removeprefix("DICT_"): getattr(cv2.aruco, name) for name in names}


def charuco_board(board: Board, *, is_legacy: bool = False) -> Any:
    """The same as OpenCV's object.

    Args:
        board: With markers.
        is_legacy: As OpenCV drew boards with an even number of rows before version 4.6: the first square is white.
    """
    import cv2

    markers = cv2.aruco.getPredefinedDictionary(dictionaries()[board.dictionary])
    made = cv2.aruco.CharucoBoard((board.columns, board.rows), board.square_m, board.marker_m, markers)
    made.setLegacyPattern(is_legacy)
    return made


def read_board(text: str) -> Board:
    """A board from text such as "charuco:7x5:0.04:0.03:4X4_50" or "chessboard:9x6:0.03".

    Raises:
        CaptureError: It is not one, and why.
    """
    kind, *parts = text.strip().split(":")
    if kind not in ("charuco", "chessboard") or len(parts) not in ((3, 4) if kind == "charuco" else (2,)):
        raise CaptureError(f"{shown(text)} does not describe a board.", hint=HOW)
    try:
        columns, rows = (int(part) for part in parts[0].lower().split("x"))
        lengths = [float(part) for part in parts[1:3]]
    except ValueError:
        raise CaptureError(f"{shown(text)} has a number that cannot be read.", hint=HOW) from None
    if not all(3 <= side <= MAX_SQUARES for side in (columns, rows)):
        raise CaptureError(f"The board is {columns} x {rows}; each must be 3 to {MAX_SQUARES}.", hint=HOW)
    if not all(0 < length <= MAX_METRES for length in lengths):
        what = "Squares and markers" if kind == "charuco" else "Squares"
        said = " and ".join(f"{length:g}" for length in lengths)
        raise CaptureError(f"{what} of {said} m: they must be larger than 0 and at most {MAX_METRES:g} m.", hint=HOW)
    if kind == "chessboard":
        if (columns + rows) % 2 == 0:
            what = f"A chessboard of {columns} x {rows} inner corners looks the same turned by half a turn"
            raise CaptureError(f"{what}.", hint="Use one with an even and an odd number, such as 9x6, or ChArUco.")
        return Board(columns, rows, lengths[0])
    if lengths[1] >= lengths[0]:
        raise CaptureError(
            f"Markers of {lengths[1]:g} m do not fit into squares of {lengths[0]:g} m.", hint="Give the square first."
        )
    return _with_markers(
        Board(columns, rows, lengths[0], lengths[1], parts[3] if len(parts) == 4 else DEFAULT_DICTIONARY)
    )


def _with_markers(board: Board) -> Board:
    import cv2

    dictionary, known = board.dictionary.upper().removeprefix("DICT_"), dictionaries()
    if dictionary not in known:
        raise CaptureError(f"{shown(dictionary)} is not a dictionary of markers.", hint=f"Known: {', '.join(known)}.")
    sizes = {name: len(cv2.aruco.getPredefinedDictionary(number).bytesList) for name, number in known.items()}
    n_there = sizes[dictionary]
    n_needed = board.columns * board.rows // 2
    if n_needed > n_there:
        large = [name for name, n_markers in sizes.items() if n_markers >= n_needed]
        raise CaptureError(
            f"A board of {board.columns} x {board.rows} squares needs {n_needed} markers; {dictionary} has {n_there}.",
            hint=f"Take a larger dictionary: {', '.join(large)}."
            if large
            else f"At most {max(sizes.values())} are known.",
        )
    return Board(board.columns, board.rows, board.square_m, board.marker_m, dictionary)
