"""The fit of smooth local brightness: what it removes, what it leaves, and pictures in which little stands still."""

import numpy as np
import pytest

from engine.images.psnr import psnr
from engine.metrics.pictures.light import FURTHEST, fit_light
from engine.metrics.pictures.picture import measure_picture
from tests.engine.metrics.made_pictures import disturbed, scene

SIZE = (120, 160)
ALL = np.ones(SIZE, bool)


def shadow() -> np.ndarray:
    """A soft shadow in one half of the picture. [H, W, 1]"""
    x = np.linspace(-4, 4, SIZE[1])
    return np.broadcast_to(1.0 - 0.2 / (1.0 + np.exp(-x)), SIZE)[:, :, None]


def test_a_soft_shadow_is_removed():
    image = 0.1 + 0.8 * scene(*SIZE)
    truth = image * shadow()
    relit = fit_light(image, truth, ALL)
    assert relit is not None
    assert psnr(image, truth) < 25
    assert psnr(relit, truth) > 42


def test_what_is_no_light_stays():
    """A coarse factor cannot follow texture."""
    truth = 0.1 + 0.8 * scene(*SIZE)
    image = truth + np.random.default_rng(0).normal(0, 0.05, truth.shape)
    relit = fit_light(image, truth, ALL)
    assert relit is not None
    assert psnr(relit, truth) == pytest.approx(psnr(image, truth), abs=0.1)


def test_a_moving_part_takes_its_factor_from_what_is_around_it():
    image = np.full((*SIZE, 3), 0.5)
    truth = image * 0.8
    is_still = ALL.copy()
    is_still[20:110, 30:120] = False
    truth[20:110, 30:120] = 0.05  # somebody in black, who must not darken the fit
    relit = fit_light(image, truth, is_still)
    assert relit is not None
    assert relit == pytest.approx(np.full((*SIZE, 3), 0.4), abs=0.005)


def test_without_a_pixel_that_stands_still_there_is_no_fit():
    image = scene(*SIZE)
    assert fit_light(image, image, ~ALL) is None
    found = measure_picture(image, (255 * image).astype(np.uint8), ALL, metrics="quick")
    assert found.figures["psnr_light"] is None
    assert found.missing["psnr_light"] == "no pixels that do not move"


def test_black_and_white_give_no_wild_factors():
    black, white = np.zeros((*SIZE, 3)), np.ones((*SIZE, 3))
    assert fit_light(black, white, ALL) == pytest.approx(black)
    relit = fit_light(white, black, ALL)
    assert relit is not None
    assert relit.min() == pytest.approx(1 / FURTHEST)


@pytest.mark.parametrize("size", [(1, 1), (3, 200), (200, 3), (17, 15)])
def test_any_size_will_do(size):
    image = scene(*size) if min(size) > 1 else np.full((1, 1, 3), 0.5)
    relit = fit_light(image, image, np.ones(size, bool))
    assert relit == pytest.approx(image, abs=1e-5)


def test_the_column_is_that_of_the_fitted_picture_in_the_light_of_the_truth():
    truth = disturbed(scene(*SIZE))
    image = np.clip(0.9 * scene(*SIZE) / shadow() * [1.05, 1.0, 0.95], 0, 1)
    found = measure_picture(image, (255 * truth).astype(np.uint8), ~ALL, metrics="quick").figures
    raw, fit, light = (found[name] for name in ("psnr", "psnr_fit", "psnr_light"))
    assert raw is not None
    assert fit is not None
    assert light is not None
    assert raw < fit < light
