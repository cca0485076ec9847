"""Boards in videos: which frames are looked at, and where the board is in them."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np

from engine.calibration.boards.board import HOW, Board
from engine.calibration.boards.detection import BoardStyle, BoardView, find_style, finder, other_markers
from engine.calibration.matching.pictures import chosen_frames
from engine.calibration.videos import PlainVideo
from engine.errors import PreparationError
from engine.parallel import map_ordered

N_PAIRS = 90
"""Of consecutive frames that are looked at, spread over the videos: how a board moves says which camera is late."""
N_PROBED = 8
"""Frames of each camera that are searched for the style of the board and, if it is not there, for another board."""
MAX_PROBED_CAMERAS = 6


def frames_to_look_at(n_frames: int) -> list[int]:
    """Frame indices, in pairs where there are more than are looked at."""
    if n_frames <= 2 * N_PAIRS:
        return list(range(n_frames))
    firsts = chosen_frames(n_frames - 1, N_PAIRS)
    return sorted({frame for first in firsts for frame in (first, first + 1)})


def board_views(
    videos: list[PlainVideo], board: Board, frames: list[int], advance: Callable[[float], None] = lambda _: None
) -> list[dict[int, BoardView]]:
    """What each camera sees of a board in these frames: a view by camera, frame after frame.

    Args:
        videos: Of all cameras.
        board: That is looked for.
        frames: Indices, rising.
        advance: Called with the share of a camera that is done, by any thread.
    Raises:
        CaptureError: Frames cannot be decoded. PreparationError: No camera sees the board; says what is there instead.
    """
    style = _style(videos, board, frames)
    moments: list[dict[int, BoardView]] = [{} for _ in frames]
    lock = threading.Lock()

    def one(row: int) -> None:
        find = finder(board, style)
        for number, frame in enumerate(videos[row].source.read(frames)):
            view = find(frame)
            if view is not None:
                with lock:
                    moments[number][row] = view
            advance(1 / len(frames))
        videos[row].source.close()

    map_ordered(one, range(len(videos)))
    return moments


def _style(videos: list[PlainVideo], board: Board, frames: list[int]) -> BoardStyle:
    probed = [frames[i] for i in chosen_frames(len(frames), N_PROBED)]
    seen: list[np.ndarray] = []
    for row in chosen_frames(len(videos), MAX_PROBED_CAMERAS):
        pictures = list(videos[row].source.read(probed))
        style = find_style(board, pictures)
        if style is not None:
            return style
        seen += pictures[1::2]
    instead = other_markers(board, seen) if board.is_charuco else ""
    cameras = "no camera" if len(videos) > 1 else "the camera"
    what = f"The board {board.text} was found in {cameras}, in {len(probed)} frames of each"
    hint = (
        "Film it larger, sharper and in even light, and check what is printed on it."
        if not instead
        else f"Describe the board that was filmed. {HOW}"
    )
    raise PreparationError(f"{what}{': ' + instead if instead else ''}.", hint=hint)
