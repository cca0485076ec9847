"""tOF: two frames by hand, and what has none."""

import numpy as np
import pytest
from scipy import ndimage

from app.lab.added.tof import MIN_SIDE_PX, Motion, grey_levels, motion_of, tof
from engine.metrics.pictures.colors import to_levels


def textured(shift_px: int = 0, size: tuple[int, int] = (96, 128)) -> np.ndarray:
    """A smooth random picture, moved to the right. [H, W, 3] float32 in 0..1"""
    noise = np.random.default_rng(5).uniform(0, 1, (size[0] + 40, size[1] + 40))
    smooth = ndimage.gaussian_filter(noise, 3.0)
    smooth = np.roll((smooth - smooth.min()) / np.ptp(smooth), shift_px, 1)[20:-20, 20:-20]
    return np.repeat(smooth[..., None], 3, -1).astype(np.float32)


def motion(render: np.ndarray, truth: np.ndarray, is_valid: np.ndarray | None = None) -> Motion:
    found = motion_of(render, to_levels(truth), is_valid)
    assert found is not None
    return found


def test_a_render_that_moves_as_the_truth_does_has_none():
    before, after = textured(), textured(2)
    assert tof(motion(before, before), motion(after, after)) == 0.0


@pytest.mark.parametrize("shift_px", [1, 2, -3])
def test_a_render_that_moves_alone_has_its_shift(shift_px):
    truth = textured()
    found = tof(motion(truth, truth), motion(textured(shift_px), truth))
    assert found == pytest.approx(abs(shift_px), rel=0.1)


def test_a_render_that_stands_while_the_truth_moves_has_the_same():
    truth, moved = textured(), textured(2)
    standing = tof(motion(truth, truth), motion(truth, moved))
    assert standing == tof(motion(truth, truth), motion(moved, truth))


def test_only_what_the_camera_sees_and_the_middle_count():
    truth = textured()
    half = truth.copy()
    half[:, 64:] = textured(2)[:, 64:]
    is_left = np.zeros(truth.shape[:2], bool)
    is_left[:, :40] = True
    later = motion(half, truth)

    def seen(is_valid: np.ndarray | None) -> float | None:
        return tof(motion(truth, truth, is_valid), later)

    left, whole, right = seen(is_left), seen(None), seen(~is_left)
    assert left is not None
    assert whole is not None
    assert right is not None
    assert left < 0.05 < whole < right
    assert tof(motion(truth, truth), motion(half, truth, is_left)) == left, "of the later frame as well"
    assert seen(np.zeros_like(is_left)) is None
    border = np.ones_like(is_left)
    border[8:-8, 8:-8] = False  # a height of 96 px leaves 64 in the middle, a width of 128 leaves 96
    assert seen(border) is None


def test_pictures_of_one_colour_have_none_and_small_ones_no_figure():
    flat = np.full((64, 64, 3), 0.5, np.float32)
    assert tof(motion(flat, flat), motion(flat, flat)) == 0.0
    assert motion_of(flat[: MIN_SIDE_PX - 1], to_levels(flat[: MIN_SIDE_PX - 1])) is None
    assert motion_of(np.full_like(flat, np.nan), to_levels(flat)) is None
    smallest = flat[:MIN_SIDE_PX]
    assert tof(motion(smallest, smallest), motion(smallest, smallest)) == 0.0


def test_grey_is_that_of_television():
    levels = np.array([[[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255], [1, 1, 1]]], np.uint8)
    assert grey_levels(levels).tolist() == [[76.0, 150.0, 29.0, 255.0, 1.0]]
