"""Which colours are compared."""

import numpy as np
import pytest

from engine.images.psnr import MAX_PSNR_DB, psnr
from engine.metrics.pictures.colors import as_shown, correct_colors, fit_colors, to_levels
from engine.metrics.pictures.picture import measure_picture
from engine.metrics.pictures.similarity import masked_mean
from tests.engine.metrics.made_pictures import scene


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


def corrected_as_gsplat_does(image: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """The definition written out once more, by another way: least squares of the truth and a column of ones."""
    channels = []
    for x, y in zip(image.reshape(-1, 3).T, truth.reshape(-1, 3).T, strict=True):
        (a, b), *_ = np.linalg.lstsq(np.stack([y, np.ones_like(y)], 1), x, rcond=None)
        channels.append(np.clip((x - b) / a, 0.0, 1.0))
    return np.stack(channels, -1).reshape(image.shape)


def test_a_colour_correction_undoes_what_leads_from_the_truth_to_the_picture(rng):
    truth = rng.random((9, 11, 3))
    spoiled = 0.1 + truth * [0.7, 0.5, 0.8]
    assert np.allclose(correct_colors(spoiled, truth), truth)
    noisy = spoiled + 0.05 * rng.standard_normal(truth.shape)
    assert np.allclose(correct_colors(noisy, truth), corrected_as_gsplat_does(noisy, truth))


def test_a_colour_correction_by_hand():
    """Truth 0, 1 and picture 0.2, 0.2, 0.6, 0.6 become 0, 0, 1, 1; one pixel off costs as much as its share says."""
    truth = np.repeat([[0.0, 0.0, 1.0, 1.0]], 3, axis=0).T[:, None]
    image = np.repeat([[0.2, 0.2, 0.6, 0.6]], 3, axis=0).T[:, None]
    assert np.allclose(correct_colors(image, truth), truth)
    image[0] += 0.1  # of the fit from 0.25 to 0.6: slope 0.35
    expected = [0.05 / 0.35, 0.0, 1.0, 1.0]
    assert np.allclose(correct_colors(image, truth)[:, 0, 1], expected)


def test_a_colour_correction_is_less_generous_than_the_colour_fit(rng):
    truth = 0.2 + 0.6 * rng.random((40, 50, 3))
    image = truth + 0.1 * rng.standard_normal(truth.shape)
    raw, corrected, fitted = (psnr(x, truth) for x in (image, correct_colors(image, truth), fit_colors(image, truth)))
    assert corrected < raw + 0.01 < fitted


@pytest.mark.parametrize(("image_level", "truth_level"), [(None, 0.4), (0.3, None), (0.3, 0.9), (0.3, 0.3)])
def test_a_channel_of_one_colour_is_only_shifted_by_the_correction(rng, image_level, truth_level):
    image, truth = (
        rng.uniform(0.3, 0.6, (9, 11, 3)) if level is None else np.full((9, 11, 3), level)
        for level in (image_level, truth_level)
    )
    expected = np.clip(image - image.mean((0, 1)) + truth.mean((0, 1)), 0.0, 1.0)
    assert np.allclose(correct_colors(image, truth), expected)


def test_a_correction_is_made_from_valid_pixels_and_clamped(rng):
    truth = rng.random((9, 11, 3))
    image = 0.5 * truth
    mask = np.ones((9, 11), bool)
    mask[2:4], image[2:4] = False, 0.9
    corrected = correct_colors(image, truth, mask)
    assert np.allclose(corrected[mask], truth[mask])
    assert (corrected[2:4] == 1.0).all()


def test_cc_psnr_of_a_picture_is_that_of_the_corrected_one():
    truth = scene(48, 64)
    pixels = to_levels(truth)
    image = np.clip(0.8 * truth + 0.1, 0, 1) + 0.02 * np.random.default_rng(1).standard_normal(truth.shape)
    found = measure_picture(image, pixels, np.zeros((48, 64), bool), metrics="quick").figures
    shown, truth = np.clip(image, 0, 1).astype(np.float32), pixels / np.float32(255)
    assert found["cc_psnr"] == pytest.approx(psnr(corrected_as_gsplat_does(shown, truth), truth), abs=1e-3)
    raw, corrected, fitted = (found[name] or 0.0 for name in ("psnr", "cc_psnr", "psnr_fit"))
    assert 0.0 < raw < corrected < fitted
    dark = measure_picture(np.zeros_like(image), np.zeros_like(pixels), np.zeros((48, 64), bool), metrics="quick")
    assert dark.figures["cc_psnr"] == MAX_PSNR_DB
