"""clipgstream board: a calibration board to print, at its true size."""

from __future__ import annotations

import argparse

from app.cli.arguments import EXIT_OK, path_argument
from app.training.service import Launch
from engine.calibration.boards.board import read_board
from engine.calibration.boards.printing import write_board
from engine.text import printable


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream board`."""
    command.add_argument(
        "board",
        metavar="BOARD",
        help="charuco:COLUMNSxROWS:SQUARE:MARKER[:DICTIONARY] or chessboard:COLUMNSxROWS:SQUARE; squares (of a "
        "chessboard: inner corners), then lengths in metres, such as charuco:7x5:0.04:0.03",
    )
    command.add_argument(
        "--out", type=path_argument, required=True, metavar="FILE", help="a .pdf or .png file; print it at 100 %%"
    )
    command.add_argument("--replace", action="store_true", help="replace an existing file")


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream board: write the file. Returns the exit code."""
    board = read_board(options.board)
    width_mm, height_mm = write_board(board, options.out, is_replacing=options.replace)
    print(
        printable(
            f"{options.out}: a page of {width_mm:.0f} x {height_mm:.0f} mm. Print it at 100 %, glue it onto a flat, "
            f"stiff plate, and measure a square: {1000 * board.square_m:g} mm. Then: clipgstream calibrate VIDEOS "
            f"--board {board.text}"
        )
    )
    return EXIT_OK
