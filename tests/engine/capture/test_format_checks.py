"""What the checks that all readers share let through, and what they say of the rest."""

from pathlib import Path

import numpy as np
import pytest

from engine.capture.files.media import ImageHeader
from engine.capture.layout.format_checks import (
    check_equal_counts,
    check_fps,
    check_image_header,
    check_K,
    check_names,
    check_pose,
    is_name,
    is_whole,
    parse_matrix,
    parse_size,
    raise_problems,
    shortened,
)
from engine.capture.layout.limits import FPS_RANGE, MAX_NAME_LENGTH, MAX_POSITION, MAX_SIDE
from engine.errors import CaptureError

PATH = Path("cameras.json")
K = np.array([[100.0, 0.0, 80.0], [0.0, 100.0, 60.0], [0.0, 0.0, 1.0]])


def messages(problems: list[CaptureError]) -> str:
    """All that was said, in one text."""
    return "\n".join(problem.message for problem in problems)


@pytest.mark.parametrize(("value", "expected"), [(3, True), (True, False), (3.0, False), ("3", False), (None, False)])
def test_whole_numbers(value, expected):
    assert is_whole(value) is expected


@pytest.mark.parametrize(
    "value", [None, "text", [[1, 2], [3]], [["1", "2"], ["3", "4"]], [[1, 2, 3], [4, 5, 6]], [[True, False]] * 2]
)
def test_what_is_not_a_matrix_of_this_shape_is_not_parsed(value):
    assert parse_matrix(value, (2, 2)) is None


def test_whole_numbers_become_a_matrix_of_floats():
    matrix = parse_matrix([[1, 2], [3, 4]], (2, 2))
    assert matrix is not None
    assert matrix.dtype == np.float64


@pytest.mark.parametrize(
    ("width", "height", "is_read"),
    [(1, 1, True), (MAX_SIDE, 1, True), (MAX_SIDE + 1, 1, False), (0, 5, False), (MAX_SIDE, MAX_SIDE, False),
     (4.0, 3, False), (True, 3, False), (-4, 3, False)],
)  # fmt: skip
def test_sizes_that_are_read(width, height, is_read):
    assert (parse_size(width, height) is not None) is is_read


@pytest.mark.parametrize("fps", [*FPS_RANGE, 30, 29.97])
def test_frame_rates_that_cameras_have(fps):
    assert check_fps(fps, PATH) == []


@pytest.mark.parametrize("fps", [0, -30, float("nan"), float("inf"), True, "30", None, FPS_RANGE[1] * 1.01])
def test_frame_rates_that_no_camera_has(fps):
    assert "fps is" in messages(check_fps(fps, PATH))


@pytest.mark.parametrize(
    ("name", "expected"), [("cam 01", True), ("", False), (" ", False), ("a\nb", False), ("x" * MAX_NAME_LENGTH, True),
                           ("x" * (MAX_NAME_LENGTH + 1), False)]
)  # fmt: skip
def test_names_that_can_be_shown_and_typed(name, expected):
    assert is_name(name) is expected


def test_names_that_occur_twice_are_counted_and_odd_ones_are_named_by_their_row():
    said = messages(check_names(["a", "b", "a", "a", "\0"], PATH))
    assert '3 cameras are called "a"' in said
    assert "Camera number 4" in said
    assert "no cameras" in messages(check_names([], PATH))


def test_a_rigid_pose_has_no_faults():
    assert check_pose("a", np.eye(4), PATH) == []


@pytest.mark.parametrize(
    ("row", "column", "value", "said"),
    [(0, 3, np.nan, "NaN"), (0, 0, 1e300, "in its rotation"), (1, 3, 2 * MAX_POSITION, "moves it by"),
     (0, 0, -1.0, "determinant is -1"), (0, 0, 1.01, "R R\\^T differs from the identity by 0.0201"),
     (3, 3, 2.0, "0 0 0 2 as its last row")],
)  # fmt: skip
def test_a_pose_that_is_not_rigid_is_told_with_its_numbers(row, column, value, said):
    pose = np.eye(4)
    pose[row, column] = value
    problems = check_pose("a", pose, PATH)
    with pytest.raises(CaptureError, match=said):
        raise_problems(problems, PATH.parent)


@pytest.mark.parametrize(
    ("row", "column", "value", "said"),
    [(0, 0, -100.0, "must be positive"), (0, 0, 1e9, "times the side of the image"), (0, 2, -81.0, "far outside"),
     (2, 2, 2.0, "the last row"), (1, 1, np.inf, "NaN or infinity")],
)  # fmt: skip
def test_intrinsics_of_no_camera_are_told(row, column, value, said):
    bad = K.copy()
    bad[row, column] = value
    assert check_K("a", K, (160, 120), PATH) == []
    assert said in messages(check_K("a", bad, (160, 120), PATH))


def test_a_picture_that_exif_lays_on_its_side_is_told_as_the_cause():
    turned = ImageHeader((120, 160), orientation=6, n_bytes=1000)
    assert "EXIF" in messages(check_image_header("a", turned, (160, 120), PATH))
    upright = ImageHeader((120, 160), orientation=1, n_bytes=1000)
    assert "EXIF" not in messages(check_image_header("a", upright, (160, 120), PATH))
    assert check_image_header("a", turned, (120, 160), PATH) == []


@pytest.mark.parametrize(
    ("counts", "said"),
    [((5, 5, 5), []), ((5, 5, 4), ["c"]), ((5, 5, 0), ["c"]), ((5, 4), ["b"]), ((4, 5), ["a"]), ((0, 4, 5, 5), "ab")],
)
def test_cameras_with_another_number_of_frames_than_most(counts, said):
    named = dict(zip("abcd", counts, strict=False))
    problems = check_equal_counts(named, {name: Path(name) for name in named})
    assert [str(problem.path) for problem in problems] == list(said)


def test_one_problem_is_raised_as_it_is_and_several_are_listed():
    first, second = CaptureError("one", hint="h"), CaptureError("two", hint="h")
    raise_problems([], PATH)
    with pytest.raises(CaptureError) as found:
        raise_problems([first], PATH)
    assert found.value is first
    with pytest.raises(CaptureError, match="2 problems"):
        raise_problems([first, second], PATH)


def test_long_lists_are_shortened():
    assert shortened(["a", "b", "c"]) == "a, b, c"
    assert shortened(["a", "b", "c", "d", "e"]) == "a, b, c and 2 more"
