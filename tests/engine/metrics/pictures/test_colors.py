"""Which colours are compared."""

import numpy as np
import pytest

from engine.metrics.pictures.colors import as_shown, fit_colors, to_levels
from engine.metrics.pictures.similarity import masked_mean


def test_levels_are_clamped_and_rounded_to_the_nearest():
    image = np.array([[[-0.5, 0.0, 0.5 / 255 - 1e-6], [0.5 / 255 + 1e-6, 1.0, 7.0]]])
    assert to_levels(image).tolist() == [[[0, 0, 0], [1, 255, 255]]]


def test_every_level_comes_back_as_itself():
    levels = np.arange(256, dtype=np.uint8).repeat(3).reshape(16, 16, 3)
    assert np.array_equal(to_levels(levels / 255.0), levels)
    assert np.array_equal(as_shown(levels / 255.0, "8bit"), levels / np.float32(255.0))


def test_floats_are_clamped_only_and_nan_stays_nan():
    image = np.array([[[-1.0, 0.123456, 2.0], [np.nan, 0.0, 1.0]]])
    shown = as_shown(image, "float")
    assert shown[0, 0].tolist() == pytest.approx([0.0, 0.123456, 1.0])
    assert np.isnan(shown[0, 1, 0])
    assert np.isnan(as_shown(image, "8bit")[0, 1, 0])


def test_a_gain_and_an_offset_per_channel_are_taken_out(rng):
    truth = rng.random((9, 11, 3))
    spoiled = (truth - [0.1, 0.0, -0.2]) / [1.2, 0.7, 1.0]
    assert np.allclose(fit_colors(spoiled, truth), truth)


def test_a_channel_of_one_colour_only_gets_an_offset(rng):
    truth = rng.random((9, 11, 3))
    fitted = fit_colors(np.full((9, 11, 3), 0.3), truth)
    assert np.allclose(fitted, truth.mean((0, 1)))


def test_the_mean_over_no_pixel_is_nan():
    values = np.array([[1.0, 3.0], [5.0, 7.0]], np.float32)
    assert masked_mean(values, None) == 4.0
    assert masked_mean(values, np.array([[True, False], [False, True]])) == 4.0
    assert np.isnan(masked_mean(values, np.zeros((2, 2), bool)))
