"""FLIP against the authors' own package, by hand, and for any number of threads."""

import hypothesis.extra.numpy as hnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import get_num_threads, set_num_threads

from engine.metrics.pictures.flip import flip, flip_map
from engine.metrics.pictures.flip_lanes import PIXELS_PER_DEGREE
from tests.engine.metrics.made_pictures import disturbed, scene

PIXEL_ERROR = 5e-4
"""Largest seen 1.1e-4 where the features of both pictures are equal, else 2.2e-5: they enter by the square root of
their difference, which magnifies rounding near zero, in the authors' code as here."""
MEAN_ERROR = 1e-6
"""Of pictures with texture; largest seen 1.7e-7."""


def by_the_authors(image: np.ndarray, truth: np.ndarray) -> tuple[np.ndarray, dict[str, float]]:
    evaluator = pytest.importorskip("flip_evaluator", reason="there is no wheel for this platform")
    reference, test = (np.ascontiguousarray(picture, np.float32) for picture in (truth, image))
    errors, _, parameters = evaluator.evaluate(reference, test, "LDR", applyMagma=False, computeMeanError=False)
    return errors[..., 0], parameters


def assert_same(image: np.ndarray, truth: np.ndarray) -> None:
    found, (expected, _) = flip_map(image, truth), by_the_authors(image, truth)
    assert found.shape == expected.shape
    assert np.abs(found - expected).max() < PIXEL_ERROR
    limit = MEAN_ERROR if found.size > 500 and truth.std() > 0.01 else PIXEL_ERROR
    assert found.mean(dtype=np.float64) == pytest.approx(expected.mean(dtype=np.float64), abs=limit)


@pytest.mark.parametrize("amount", [0.0, 0.003, 0.05, 0.5])
@pytest.mark.parametrize("size", [(50, 70), (181, 333)])
def test_flip_is_that_of_the_authors(size, amount):
    truth = scene(*size)
    assert_same(disturbed(truth, amount=amount), truth)


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (40, 1), (3, 15), (2, 16), (5, 17), (21, 33)])
def test_pictures_smaller_than_the_filters_are_continued_by_their_border(size):
    rng = np.random.default_rng(3)
    assert_same(rng.random((*size, 3)), rng.random((*size, 3)))


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(
    truth=hnp.arrays(np.float32, (12, 19, 3), elements=st.floats(0, 1, width=32)),
    image=hnp.arrays(np.float32, (12, 19, 3), elements=st.floats(0, 1, width=32)),
)
def test_flip_of_any_picture_is_that_of_the_authors(truth, image):
    assert_same(image, truth)


@pytest.mark.parametrize("color", [(0, 0, 0), (1, 1, 1), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0.04, 0.041, 0.5)])
@pytest.mark.parametrize("other", [(0, 0, 0), (1, 1, 1), (0, 1, 0), (0.004, 0.004, 0.004)])
def test_flat_pictures(color, other):
    assert_same(np.full((9, 18, 3), color, np.float32), np.full((9, 18, 3), other, np.float32))


def test_pictures_of_black_and_white_dots():
    rng = np.random.default_rng(4)
    dots, others = ((rng.random((64, 48, 1)) < share) * np.ones(3) for share in (0.5, 0.02))
    assert_same(dots, others)
    found, (expected, _) = flip_map(dots, 1.0 - dots), by_the_authors(dots, 1.0 - dots)
    assert np.abs(found - expected).max() < PIXEL_ERROR  # equal edges and points: their difference is rounding alone


def test_flip_by_hand():
    green, blue = np.zeros((20, 20, 3)), np.zeros((20, 20, 3))
    green[..., 1], blue[..., 2] = 1.0, 1.0
    assert flip(green, blue) == pytest.approx(1.0, abs=1e-6)  # the pair of colours that FLIP calls the farthest apart
    assert flip(green, green) == 0.0
    assert flip(green * 3 - 1, blue) == flip(green, blue)  # what is shown is clamped


def test_the_viewing_distance_is_that_of_the_tool():
    _, parameters = by_the_authors(np.zeros((2, 2, 3)), np.zeros((2, 2, 3)))
    assert pytest.approx(parameters["ppd"]) == PIXELS_PER_DEGREE


def test_flip_of_a_mask_is_the_mean_of_its_pixels():
    truth = scene(50, 70)
    image, mask = disturbed(truth), np.zeros((50, 70), bool)
    mask[10:20, 5:9] = True
    assert flip(image, truth, mask) == pytest.approx(flip_map(image, truth)[10:20, 5:9].mean(), abs=1e-6)
    assert np.isnan(flip(image, truth, np.zeros_like(mask)))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite_are_refused(value):
    image = np.zeros((8, 8, 3))
    image[3, 4, 1] = value
    for pair in ((image, np.zeros_like(image)), (np.zeros_like(image), image)):
        with pytest.raises(ValueError, match="not finite"):
            flip(*pair)
    with pytest.raises(ValueError, match="without pixels"):
        flip(np.zeros((0, 8, 3)), np.zeros((0, 8, 3)))


def test_the_same_bits_for_any_number_of_threads():
    truth = scene(61, 90)
    image, n_threads = disturbed(truth), get_num_threads()
    try:
        maps = []
        for n in (1, n_threads):
            set_num_threads(n)
            maps.append(flip_map(image, truth).copy())
    finally:
        set_num_threads(n_threads)
    assert np.array_equal(*maps)
