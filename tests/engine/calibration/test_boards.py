"""Boards: what they are, where cameras stand that see them, and what is said where something is wrong."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from PIL import Image

from engine.calibration.boards import detection
from engine.calibration.boards.board import Board, dictionaries, read_board
from engine.calibration.boards.calibrating import BoardProgress, _finished, calibrate_by_board
from engine.calibration.boards.detection import BoardStyle, BoardView, find_style, finder, other_markers
from engine.calibration.boards.printing import draw_board, write_board
from engine.calibration.boards.solution import BoardSolution, _said_apart, solve_boards
from engine.calibration.calibrated import Calibration
from engine.calibration.options import CalibrationOptions
from engine.calibration.videos import PlainVideo
from engine.errors import CaptureError, PreparationError
from tests.engine.calibration.made_boards import BOARD, SIZE, BoardPictures, held_boards, ring, views_of
from tests.engine.calibration.made_rigs import off_truth

N_CAMERAS, N_MOMENTS = 5, 120
FRAMES = np.arange(N_MOMENTS)


@cache
def views() -> list[dict[int, BoardView]]:
    """Of a ring of cameras 72 degrees apart, in consecutive frames."""
    return views_of(ring(N_CAMERAS), *held_boards(N_MOMENTS))


def solved(seen: list[dict[int, BoardView]]) -> BoardSolution:
    found = solve_boards(seen, BOARD.corners, np.tile(SIZE, (N_CAMERAS, 1)), "simple")
    assert isinstance(found, BoardSolution), found
    return found


def finished(found: BoardSolution, up: str = "cameras") -> Calibration:
    videos = [PlainVideo(f"cam{row}", None, SIZE, 30.0) for row in range(N_CAMERAS)]  # type: ignore[arg-type]
    sizes = np.tile(SIZE, (N_CAMERAS, 1))
    return _finished(found, videos, FRAMES, sizes, CalibrationOptions(up=up))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("text", "board"),
    [
        ("charuco:7x5:0.04:0.03", Board(7, 5, 0.04, 0.03, "4X4_50")),
        ("charuco:11x8:0.06:0.045:DICT_5X5_100", Board(11, 8, 0.06, 0.045, "5X5_100")),
        ("chessboard:9x6:0.03", Board(9, 6, 0.03)),
    ],
)
def test_a_board_is_read_and_written_as_text(text: str, board: Board) -> None:
    assert read_board(text) == board
    assert read_board(board.text) == board


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "does not describe a board"),
        ("charuco:7x5", "does not describe"),
        ("charuco:7:0.04:0.03", "cannot be read"),
        ("charuco:7x5:nan:0.03", "larger than 0"),
        ("charuco:7x5:40:30", "Squares and markers of 40 and 30 m"),
        ("charuco:7x5:0.03:0.04", "do not fit"),
        ("charuco:7x5:0.04:0.03:9X9_50", "not a dictionary"),
        ("charuco:20x20:0.04:0.03:4X4_50", "needs 200 markers; 4X4_50 has 50"),
        (
            "charuco:45x45:0.04:0.03:4X4_50",
            "needs 1012 markers; 4X4_50 has 50. Take a larger dictionary: [A-Z0-9_, ]*AR",
        ),
        ("charuco:90x90:0.04:0.03:4X4_50", "needs 4050 markers; 4X4_50 has 50. At most 2320 are known"),
        ("chessboard:999999999x6:0.03", "must be 3 to 100"),
        ("chessboard:8x6:0.03", "looks the same"),
    ],
)
def test_what_is_not_a_board_is_refused(text: str, said: str) -> None:
    with pytest.raises(CaptureError, match=said):
        read_board(text)


@pytest.mark.slow
def test_cameras_that_face_each_other_are_found_exactly_and_in_metres() -> None:
    truth, found = ring(N_CAMERAS), solved(views())
    angle_deg, distance = off_truth(found.cameras, truth)
    assert found.rows.tolist() == list(range(N_CAMERAS))
    assert angle_deg < 0.15  # mostly an exchange with the principal point
    assert distance < 0.003
    assert np.abs(found.cameras.focals / truth.focals - 1).max() < 0.003
    apart = [np.linalg.norm(cameras.centers[0] - cameras.centers[2]) for cameras in (found.cameras, truth)]
    assert apart[0] == pytest.approx(apart[1], rel=0.003)
    calibration = finished(found)
    assert not any(calibration.found.doubts)
    assert calibration.found.is_metric
    assert calibration.found.up == "cameras"


@pytest.mark.slow
def test_a_camera_that_is_late_or_sees_too_little_is_said() -> None:
    late = [dict(moment) for moment in views()]
    behind = views_of(ring(N_CAMERAS), *held_boards(N_MOMENTS, late=0.5))
    for number, moment in enumerate(late):
        moment.pop(2, None)
        moment |= {2: behind[number][2]} if 2 in behind[number] else {}
    seen_by_4 = [moment for moment in late if 4 in moment]
    for moment in seen_by_4[5:]:
        moment.pop(4)
    calibration = finished(solved(late))
    assert [missing.name for missing in calibration.missing] == ["cam4"]
    assert calibration.missing[0].reason == "the board was found in 5 pictures of it; 6 are needed"
    assert [bool(doubt) for doubt in calibration.found.doubts] == [False, False, True, False]
    assert "seem to come late; synchronise" in calibration.found.doubts[2]


@pytest.mark.slow
def test_up_is_away_from_a_board_that_lies_on_the_floor() -> None:
    rotations, translations = held_boards(N_MOMENTS)
    rotations[:5] = np.diag([1.0, -1.0, -1.0])
    translations[:5] = (-0.2, 0.1, 0.0)
    calibration = finished(solved(views_of(ring(N_CAMERAS), rotations, translations)), "floor")
    assert calibration.found.up == "board"
    np.testing.assert_allclose(calibration.found.rig.centers[:, 2], ring(N_CAMERAS).centers[:, 2], atol=0.01)


def test_nothing_in_common_is_no_calibration() -> None:
    alone = [{row: view} for moment in views() for row, view in moment.items()]
    said = solve_boards(alone[:40], BOARD.corners, np.tile(SIZE, (N_CAMERAS, 1)), "simple")
    assert said == "no two of them saw the board at the same moment"


def test_cameras_keep_their_names_where_none_could_be_placed(monkeypatch: pytest.MonkeyPatch) -> None:
    source = SimpleNamespace(n_frames=7)
    videos = [PlainVideo(name, source, SIZE, 30.0) for name in ("left {1}", "right")]  # type: ignore[arg-type]
    monkeypatch.setattr("engine.calibration.boards.calibrating.board_views", lambda *_: [{}] * 7)
    with pytest.raises(PreparationError) as caught:
        calibrate_by_board(videos, BOARD, CalibrationOptions(), BoardProgress(lambda _: None, lambda _: None))
    why = "the board was found in 0 pictures of it; 6 are needed"
    assert caught.value.message == f"No two cameras could be placed: left {{1}}: {why}, right: {why}."


def test_how_often_two_cameras_saw_the_board_together_is_said() -> None:
    pose = np.eye(3), np.zeros(3)
    assert (
        _said_apart([{0: pose, 2: pose}] * 3)
        == "{0} and {2} saw the board together most often, 3 times, and 4 have to agree"
    )


@pytest.mark.parametrize("style", [BoardStyle(), BoardStyle(is_inverted=True)])
def test_corners_are_found_where_they_are(style: BoardStyle) -> None:
    picture, rotation, translation = pictured()
    picture = 255 - picture if style.is_inverted else picture
    assert find_style(BOARD, [picture]) == style
    view = finder(BOARD, style)(picture)
    assert view is not None
    truth = ring(N_CAMERAS).pixels(np.zeros(len(BOARD.corners), int), BOARD.corners @ rotation.T + translation)[0]
    off = view.pixels - truth[view.corners]
    assert len(view.corners) >= 20
    assert np.linalg.norm(off, axis=-1).max() < 0.5
    assert np.abs(off.mean(0)).max() < 0.06  # middles of pixels are where they are elsewhere


def test_another_board_is_named() -> None:
    picture = pictured()[0]
    other = replace(BOARD, dictionary="5X5_100")
    assert find_style(other, [picture]) is None
    assert other_markers(other, [picture]) == "the markers in the pictures are of the dictionary 4X4_50"
    assert "up to number 16" in other_markers(replace(BOARD, columns=5, rows=3), [picture])
    assert other_markers(other, [np.full((200, 200, 3), 90, np.uint8)]) == ""


def test_few_pictures_are_searched_for_other_boards(monkeypatch) -> None:
    searched, real = [], cv2.aruco.ArucoDetector

    class Counting:
        def __init__(self, dictionary) -> None:
            self._detector = real(dictionary)

        def detectMarkers(self, picture):
            searched.append(1)
            return self._detector.detectMarkers(picture)

    monkeypatch.setattr(detection.cv2.aruco, "ArucoDetector", Counting)
    grey = np.full((40, 40, 3), 90, np.uint8)
    assert other_markers(BOARD, [grey] * 24) == ""
    assert len(searched) < 2 * 24 + detection.N_ASKED * len(dictionaries())


@cache
def pictured() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A picture of a board, and where the board was."""
    camera = ring(N_CAMERAS)
    turn = camera.rotations[0].T @ np.array([[0.96, 0, 0.28], [0, 1, 0], [-0.28, 0, 0.96]])
    place = camera.centers[0] + camera.rotations[0].T @ np.array([0.05, -0.02, 0.8]) - turn @ BOARD.corners.mean(0)
    return BoardPictures(camera, 0).picture(turn, place), turn, place


def test_a_chessboard_keeps_its_first_corner_upside_down() -> None:
    board = read_board("chessboard:7x4:0.04")
    page = np.asarray(draw_board(board)[0].convert("RGB").resize((420, 280)))
    upright, turned = (finder(board, BoardStyle())(np.ascontiguousarray(each)) for each in (page, page[::-1, ::-1]))
    assert upright is not None
    assert turned is not None
    np.testing.assert_allclose(turned.pixels, np.array([420, 280]) - upright.pixels, atol=0.3)
    assert upright.pixels[0].sum() < upright.pixels[-1].sum()


def test_a_printed_board_has_its_true_size_and_is_found(tmp_path) -> None:
    board = read_board("charuco:5x4:0.03:0.022")
    path = tmp_path / "board.pdf"
    assert write_board(board, path) == pytest.approx((180, 150), abs=0.5)
    assert path.read_bytes().startswith(b"%PDF")
    assert b"/MediaBox [ 0 0 510.2" in path.read_bytes()  # 180 mm in points
    with pytest.raises(CaptureError, match="there already"):
        write_board(board, path)
    with pytest.raises(CaptureError, match=r"\.pdf or \.png"):
        write_board(board, tmp_path / "board.jpg")
    write_board(board, tmp_path / "board.png")
    with Image.open(tmp_path / "board.png") as page:
        assert page.width / page.info["dpi"][0] * 25.4 == pytest.approx(180, abs=0.5)
        picture = np.asarray(page.convert("RGB").resize((720, 600)))
    view = finder(board, BoardStyle())(picture)
    assert view is not None
    assert len(view.corners) == 12
