"""Corners of a board in pictures, and what is on a board that is not the expected one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from engine.calibration.boards.board import Board, charuco_board, dictionaries

MIN_CORNERS = 6
"""Of a view; fewer hardly say how the board is held."""
MIN_MARKERS = 3
"""Of another dictionary in one picture, for it to be on the board: single ones are found in noise."""
N_ASKED = 3
"""Pictures in which markers of all dictionaries are looked for."""
MIN_SPREAD = 0.02
"""Least width of a view's corners divided by their length: a line says nothing about how the board is held."""


@dataclass(frozen=True, slots=True)
class BoardStyle:
    """How a board is printed, which is found out. is_legacy: See `charuco_board`; is_inverted: White on black."""

    is_legacy: bool = False
    is_inverted: bool = False


STYLES = (BoardStyle(), BoardStyle(is_legacy=True), BoardStyle(False, True), BoardStyle(True, True))


@dataclass(frozen=True, slots=True)
class BoardView:
    """The board in one picture.

    Attributes:
        corners: Which of its corners are seen, rising. [K]
        pixels: Where; centres at +0.5. [K, 2]
    """

    corners: np.ndarray
    pixels: np.ndarray


def finder(board: Board, style: BoardStyle) -> Callable[[np.ndarray], BoardView | None]:
    """A function that finds the board in a picture [H, W, 3] uint8; None where too little of it is seen."""
    if not board.is_charuco:
        return lambda picture: _chessboard(board, _grey(picture, is_inverted=False))
    detector = cv2.aruco.CharucoDetector(charuco_board(board, is_legacy=style.is_legacy))
    places = board.corners[:, :2]

    def find(picture: np.ndarray) -> BoardView | None:
        pixels, numbers, _, _ = detector.detectBoard(_grey(picture, is_inverted=style.is_inverted))
        if numbers is None or len(numbers) < MIN_CORNERS:
            return None
        numbers, pixels = numbers.reshape(-1).astype(np.int64), pixels.reshape(-1, 2).astype(np.float64)
        order = np.argsort(numbers)
        spread = np.linalg.svd(places[numbers] - places[numbers].mean(0), compute_uv=False)
        if spread[1] < MIN_SPREAD * spread[0]:
            return None
        return BoardView(numbers[order], pixels[order] + 0.5)

    return find


def find_style(board: Board, pictures: Sequence[np.ndarray]) -> BoardStyle | None:
    """How the board in some pictures is printed; None where none shows it."""
    styles = STYLES if board.is_charuco else STYLES[:1]
    counts = []
    for style in styles:
        find = finder(board, style)
        views = [view for view in map(find, pictures) if view is not None]
        counts.append(sum(len(view.corners) for view in views))
    return styles[int(np.argmax(counts))] if max(counts) else None


def other_markers(board: Board, pictures: Sequence[np.ndarray]) -> str:
    """What is seen in pictures that do not show the board, in a sentence; empty where there are no markers at all.

    Only pictures with most squares are asked, and of dictionaries that begin with the same markers the smallest first:
    large ones take seconds. Of those that see as many markers, the board's own is named, else the smallest.
    """
    known = {name: cv2.aruco.getPredefinedDictionary(number) for name, number in dictionaries().items()}
    greys = _with_most_squares(cv2.aruco.ArucoDetector(known[board.dictionary]), pictures)

    def seen_of(name: str) -> np.ndarray:
        detector, found = cv2.aruco.ArucoDetector(known[name]), [np.zeros(0, np.int64)]
        for grey in greys:
            _, numbers, _ = detector.detectMarkers(grey)
            if numbers is not None and len(numbers) >= MIN_MARKERS:
                found.append(np.asarray(numbers, dtype=np.int64).reshape(-1))
        return np.concatenate(found)

    families: dict[str, list[str]] = {}
    for name in sorted(known, key=lambda name: len(known[name].bytesList)):
        families.setdefault(_family(name), []).append(name)
    family, numbers = "", np.zeros(0, np.int64)
    for one in sorted(families, key=lambda one: one != _family(board.dictionary)):
        found = seen_of(families[one][0])
        if len(found) > len(numbers):
            family, numbers = one, found
        if len(np.unique(numbers)) >= 2 * MIN_MARKERS:  # the largest come last
            break
    if not len(numbers):
        return ""
    best = families[family][0]
    for name in families[family][1:]:
        found = seen_of(name)
        if len(found) > 1.2 * len(numbers):
            best, numbers = name, found
    if family != _family(board.dictionary) or len(known[best].bytesList) > len(known[board.dictionary].bytesList):
        return f"the markers in the pictures are of the dictionary {best}"
    n_own, highest = board.columns * board.rows // 2, int(numbers.max())
    if highest >= n_own:
        return f"markers up to number {highest} are seen, but {board.columns} x {board.rows} squares have {n_own}"
    return (
        f"markers of {board.dictionary} are seen, but not as {board.columns} x {board.rows} squares have them; columns "
        "come first"
    )


def _family(dictionary: str) -> str:
    """Of dictionaries that begin with the same markers, as 4X4 of 4X4_50."""
    return dictionary.split("_")[0] if dictionary[0].isdigit() else dictionary


def _with_most_squares(detector: cv2.aruco.ArucoDetector, pictures: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Of all pictures, also inverted, the few with most squares, whatever is in them. [H, W] each"""
    counted = []
    for picture in pictures:
        for is_inverted in (False, True):
            grey = _grey(picture, is_inverted=is_inverted)
            found, _, rejected = detector.detectMarkers(grey)
            counted.append((len(found) + len(rejected), grey))
    return [grey for _, grey in sorted(counted, key=lambda one: -one[0])[:N_ASKED]]


def _grey(picture: np.ndarray, *, is_inverted: bool) -> np.ndarray:
    grey = cv2.cvtColor(np.ascontiguousarray(picture), cv2.COLOR_RGB2GRAY)
    return 255 - grey if is_inverted else grey


def _chessboard(board: Board, grey: np.ndarray) -> BoardView | None:
    size = (board.columns, board.rows)
    is_found, pixels = cv2.findChessboardCornersSB(grey, size, flags=cv2.CALIB_CB_ACCURACY)
    if not is_found:
        return None
    grid = np.asarray(pixels, dtype=np.float64).reshape(board.rows, board.columns, 2)
    along, across = grid[0, -1] - grid[0, 0], grid[-1, 0] - grid[0, 0]
    if along[0] * across[1] < along[1] * across[0]:  # corners run the other way round
        grid = grid[:, ::-1]
    if _darkness_of_first(grid, grey) < 0:  # it is held upside down
        grid = grid[::-1, ::-1]
    return BoardView(np.arange(board.columns * board.rows), np.ascontiguousarray(grid).reshape(-1, 2) + 0.5)


def _darkness_of_first(grid: np.ndarray, grey: np.ndarray) -> float:
    """How much darker the squares are that have the colour of the first one, which lies between the first corners."""
    middles = (grid[:-1, :-1] + grid[1:, :-1] + grid[:-1, 1:] + grid[1:, 1:]) / 4
    columns, rows = np.round(middles).astype(int).reshape(-1, 2).T
    height, width = grey.shape
    levels = grey[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)].astype(np.float64)
    signs = np.where(np.indices(middles.shape[:2]).sum(0).reshape(-1) % 2, 1.0, -1.0)
    return float(levels @ signs)
