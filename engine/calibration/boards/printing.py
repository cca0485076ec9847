"""A board as a file to print, at its true size."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from engine.calibration.boards.board import Board, charuco_board
from engine.errors import CaptureError
from engine.storage.files import checked_path

MAX_PIXELS = 60e6
MARGIN = 0.5
"""White around the board, in squares: markers at the edge are read by it."""
SQUARE_PX = 240
SUFFIXES = (".pdf", ".png")
INCH_M = 0.0254


def write_board(board: Board, path: Path, *, is_replacing: bool = False) -> tuple[float, float]:
    """Write the board with what it is printed below it. Returns the size of the page in mm.

    Raises:
        CaptureError: The file is there already, or its name says no known format. DiskError: It cannot be written.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise CaptureError("A board is written as .pdf or .png.", hint="Name the file board.pdf.", path=path)
    if path.exists() and not is_replacing:
        raise CaptureError("The file is there already.", hint="Name another one, or use --replace.", path=path)
    picture, px_per_m = draw_board(board)
    dots = px_per_m * INCH_M
    with checked_path(path, what="The board") as partial:
        if suffix == ".pdf":
            picture.save(partial, "PDF", resolution=dots, title=board.text)
        else:
            picture.save(partial, "PNG", dpi=(dots, dots))
    return picture.width / px_per_m * 1000, picture.height / px_per_m * 1000


def draw_board(board: Board) -> tuple[Image.Image, float]:
    """The page, black on white, and its pixels per metre."""
    extra = 0 if board.is_charuco else 1
    columns, rows = board.columns + extra, board.rows + extra
    square = int(min(SQUARE_PX, np.sqrt(MAX_PIXELS / (columns * rows))))
    if board.is_charuco:
        printed = np.asarray(charuco_board(board).generateImage((columns * square, rows * square)))
    else:
        is_white = np.indices((rows, columns)).sum(0) % 2
        printed = np.kron(is_white, np.ones((square, square), dtype=np.int64)).astype(np.uint8) * 255
    margin = round(MARGIN * square)
    page = Image.new("L", (printed.shape[1] + 2 * margin, printed.shape[0] + 2 * margin), 255)
    page.paste(Image.fromarray(printed), (margin, margin))
    text = f"{board.text}   square {1000 * board.square_m:g} mm"
    font = ImageFont.load_default(size=min(0.22 * square, 1.6 * printed.shape[1] / len(text)))
    ImageDraw.Draw(page).text((margin, margin + printed.shape[0] + 0.12 * square), text, fill=0, font=font)
    return page.convert("1", dither=Image.Dither.NONE), square / board.square_m
