"""Boards as a user films them: videos of a board in, a capture out, by the real command and its child process."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from app.cli.cli import main
from app.lab.synthetic.writing import write_video
from engine.assets import asset_path
from engine.calibration.boards.board import Board
from engine.capture.capture import open_capture
from tests.engine.calibration.made_boards import film_board, ring
from tests.engine.calibration.made_rigs import cameras_of, off_truth

N_CAMERAS, N_FRAMES, SIZE = 4, 90, (640, 480)
BOARD = Board(7, 5, 0.14, 0.105, "4X4_50")
TRUTH = ring(N_CAMERAS, size=SIZE)


@pytest.fixture(scope="module")
def filmed(tmp_path_factory) -> Path:
    """A board in front of four cameras at right angles, whose lenses bend straight lines."""
    folder = tmp_path_factory.mktemp("board")
    film_board(folder, TRUTH, BOARD, SIZE, N_FRAMES)
    return folder


@pytest.mark.slow
def test_a_filmed_board_makes_a_capture_of_a_recording(filmed: Path, tmp_path: Path, capsys) -> None:
    recording = tmp_path / "recording"
    recording.mkdir()
    for row in range(N_CAMERAS):
        scene = np.full((6, *SIZE[::-1], 3), 40 * row, np.uint8)
        write_video(recording / f"cam{row}.mp4", scene, fps=25)
    arguments = ["--board", BOARD.text, "--recording", str(recording), "--quiet"]
    assert main(["calibrate", str(filmed), *arguments]) == 0
    said = capsys.readouterr().out
    assert f"{N_CAMERAS} of {N_CAMERAS} cameras were found" in said
    assert "in metres, by the board" in said
    assert not (filmed / "capture.json").exists()

    capture = open_capture(recording)
    assert (capture.n_frames, capture.fps) == (6, 25)
    rig = capture.native_rig
    found = cameras_of(rig)
    angle_deg, distance = off_truth(found, TRUTH)
    assert angle_deg < 0.15
    assert distance < 0.003
    np.testing.assert_allclose(rig.Ks[:, 0, 0], TRUTH.focals_xy[:, 0], rtol=0.003)
    apart = [np.linalg.norm(cameras.centers[0] - cameras.centers[2]) for cameras in (found, TRUTH)]
    assert apart[0] == pytest.approx(apart[1], rel=0.003)

    (recording / "cam3.mp4").rename(tmp_path / "cam3.mp4")
    assert main(["calibrate", str(filmed), *arguments, "--replace"]) == 2
    assert "cam3 of the videos to calibrate by is not in the recording" in capsys.readouterr().err


@pytest.mark.slow
def test_another_board_than_was_filmed_is_said(filmed: Path, capsys) -> None:
    assert main(["calibrate", str(filmed), "--board", "charuco:7x5:0.14:0.105:6X6_250", "--quiet"]) == 1
    assert "the markers in the pictures are of the dictionary 4X4_50" in capsys.readouterr().err
    assert not (filmed / "capture.json").exists()


@pytest.mark.slow
def test_videos_without_a_board_are_refused(tmp_path: Path, capsys) -> None:
    for name in ("cam00.mp4", "cam01.mp4"):
        shutil.copy(asset_path("sample") / name, tmp_path)
    assert main(["calibrate", str(tmp_path), "--board", BOARD.text, "--quiet"]) == 1
    error = capsys.readouterr().err
    assert f"The board {BOARD.text} was found in no camera" in error
    assert "dictionary" not in error
    assert not (tmp_path / "capture.json").exists()


def test_a_board_that_cannot_be_read_ends_with_2(tmp_path: Path, capsys) -> None:
    assert main(["calibrate", str(tmp_path), "--board", "charuco:7x5", "--quiet"]) == 2
    assert "does not describe a board" in capsys.readouterr().err


def test_the_command_writes_a_board_to_print(tmp_path: Path, capsys) -> None:
    path = tmp_path / "board.pdf"
    assert main(["board", BOARD.text, "--out", str(path)]) == 0
    assert "a page of 1120 x 840 mm. Print it at 100 %" in capsys.readouterr().out
    assert path.read_bytes().startswith(b"%PDF")
    assert main(["board", BOARD.text, "--out", str(path)]) == 2
    assert "there already" in capsys.readouterr().err
    assert main(["board", BOARD.text, "--out", str(path), "--replace"]) == 0
    assert main(["board", "charuco:7x5:0.1:0.2", "--out", str(tmp_path / "other.pdf")]) == 2
    assert "do not fit" in capsys.readouterr().err
