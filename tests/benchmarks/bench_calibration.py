"""How exactly cameras are found by a board, and where neighbours are 36 degrees apart: largest errors of any camera.

    python -m tests.benchmarks.bench_calibration OUT CAPTURE

A board is filmed by four known cameras at right angles, whose lenses bend straight lines. Of the capture, a ring, every
second camera is calibrated from its videos alone.
"""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path

import numpy as np

from engine.calibration.boards.board import Board
from engine.calibration.calibrate import calibrate
from engine.calibration.options import CalibrationOptions
from engine.calibration.solving.cameras import Cameras
from engine.capture.capture import open_capture
from engine.errors import PreparationError
from tests.documents.table import table
from tests.engine.calibration.made_boards import film_board, ring
from tests.engine.calibration.made_rigs import cameras_of, off_truth

BOARD, SIZE, N_FRAMES = Board(7, 5, 0.14, 0.105, "4X4_50"), (640, 480), 90


def errors_of(videos: Path, options: CalibrationOptions, truth: Cameras) -> tuple[str, ...]:
    """Cameras that are found, and the largest errors of these; the truth is in the order of the videos."""
    try:
        calibration = calibrate(videos, options, report=lambda _: None)
    except PreparationError as error:
        if error.__cause__ is not None:  # the process broke down: not a refusal
            raise
        return "refused", "", "", ""
    if calibration.failure:
        return "refused", "", "", ""
    found = calibration.found
    if len(found.rig) < len(truth) or any(found.doubts):
        n_right = found.doubts.count("")
        return f"{n_right} of {len(truth)}", "", "", ""
    angle_deg, distance = off_truth(cameras_of(found.rig), truth)
    focal = np.abs(found.rig.Ks[:, 0, 0] / truth.focals_xy[:, 0] - 1).max()
    return f"{len(truth)} of {len(truth)}", f"{angle_deg:.2f}", f"{100 * distance:.2f}", f"{100 * focal:.2f}"


def main() -> None:
    """Command line; see the module docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("capture", type=Path)
    options = parser.parse_args()
    truth, folder = ring(4, size=SIZE), options.out / "board"
    folder.mkdir(parents=True, exist_ok=True)
    film_board(folder, truth, BOARD, SIZE, N_FRAMES)
    of_board = errors_of(folder, CalibrationOptions(board=BOARD), truth)
    rows = [(f"a board, 4 cameras 90 degrees apart, {SIZE[0]}x{SIZE[1]}", *of_board)]
    rig = open_capture(options.capture).native_rig
    for first, which in ((0, "even"), (1, "odd")):
        chosen, folder = list(range(first, len(rig), 2)), options.out / which
        folder.mkdir(exist_ok=True)
        for row in chosen:
            shutil.copy(options.capture / f"{rig.names[row]}.mp4", folder)
        found = errors_of(folder, CalibrationOptions(), cameras_of(rig.subset(chosen)))
        rows.append((f"videos alone, {which} cameras of {options.capture.name}, 36 degrees apart", *found))
    print(table(("filmed", "found", "direction, degrees", "place, % of the radius", "focal length, %"), rows))


if __name__ == "__main__":
    main()
