"""Image filters against scipy's."""

import numpy as np
import pytest
from scipy import ndimage

from engine.images.image_filters import (
    block_mean,
    blurred_difference,
    dilate,
    erode,
    gaussian_taps,
    remove_small_blobs,
)


@pytest.mark.parametrize("sigma_px", [0.3, 0.6, 1.0, 2.5])
def test_taps_are_symmetric_and_add_up_to_one(sigma_px):
    taps = gaussian_taps(sigma_px)
    assert taps.sum() == pytest.approx(1.0, abs=1e-6)
    assert np.array_equal(taps, taps[::-1])
    assert len(taps) // 2 >= 3 * sigma_px
    assert taps.argmax() == len(taps) // 2


def test_a_blurred_difference_is_that_of_scipy_with_borders_continued(rng):
    frame = rng.integers(0, 256, (12, 17, 3)).astype(np.uint8)
    background = rng.integers(0, 256, (12, 17, 3)).astype(np.uint8)
    difference = frame.astype(float) - background
    expected = np.zeros((12, 17))
    for channel in range(3):
        rows = ndimage.convolve1d(difference[..., channel], gaussian_taps(1.0), axis=1, mode="nearest")
        expected += np.abs(ndimage.convolve1d(rows, gaussian_taps(1.0), axis=0, mode="nearest"))
    assert np.allclose(blurred_difference(frame, background, 1.0), expected, atol=1e-3)


@pytest.mark.parametrize("radius_px", [0, 1, 2, 5, 40])
def test_masks_grow_and_shrink_as_with_scipy(rng, radius_px):
    mask = rng.random((15, 22)) > 0.9
    square = np.ones((2 * radius_px + 1,) * 2, bool)
    assert np.array_equal(dilate(mask, radius_px), ndimage.binary_dilation(mask, square))
    assert np.array_equal(erode(~mask, radius_px), ndimage.binary_erosion(~mask, square, border_value=1))


def test_blobs_that_touch_at_corners_count_together():
    mask = np.zeros((6, 8), bool)
    mask[0, 0] = mask[1, 1] = mask[2, 2] = True
    mask[5, 6:8] = True
    kept = remove_small_blobs(mask, 3)
    assert kept.sum() == 3
    assert kept[1, 1]
    assert not remove_small_blobs(mask, 4).any()


def test_block_means_leave_out_what_does_not_fill_a_block(rng):
    image = rng.random((7, 9, 3))
    small = block_mean(image, 3)
    assert small.shape == (2, 3, 3)
    assert np.allclose(small[1, 2], image[3:6, 6:9].mean((0, 1)))
