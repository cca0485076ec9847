"""Exposure of a camera against a reference: the gain that most pixels share, whatever people, shadows and lamps do."""

import numpy as np
import pytest

from engine.cloud.background.exposure import NO_CHANGE, Exposure, at_working_size, gain_of, without_noise
from engine.images.exposure_curve import to_camera

HEIGHT, WIDTH = 90, 160
GAIN = np.array([0.94, 0.96, 0.91])
"""Known to 0.2 % where a fifth of a picture stands still or more: noise of one grey level on 14,400 pixels gives less
than 0.05 %, soft shadows that count as nearly still the rest."""


def scene(seed: int = 0) -> np.ndarray:
    """Surfaces of many colours, some nearly white. [H, W, 3] 0..1"""
    rng = np.random.default_rng(seed)
    coarse = rng.uniform(0.1, 1.0, (9, 16, 3))
    return np.kron(coarse, np.ones((10, 10, 1)))


def taken(image: np.ndarray, gain: np.ndarray, seed: int = 0, noise: float = 1.0) -> np.ndarray:
    """What a camera with this exposure makes of it. uint8"""
    rng = np.random.default_rng(seed)
    levels = np.clip(image * gain, 0.0, 1.0) * 255.0 + rng.normal(0.0, noise, image.shape)
    return np.clip(np.floor(levels + 0.5), 0, 255).astype(np.uint8)


def frames(gain: np.ndarray = GAIN, change=lambda image: image) -> tuple[np.ndarray, np.ndarray]:
    """A still take, and one of another exposure in which something changed. [5, H, W, 3] each"""
    still = np.stack([taken(scene(), np.ones(3), seed) for seed in range(5)])
    later = np.stack([taken(change(scene()), gain, 10 + seed) for seed in range(5)])
    return still, later


def person(image: np.ndarray) -> np.ndarray:
    image = image.copy()
    image[10:, 30:130] = np.random.default_rng(1).uniform(0.02, 0.5, image[10:, 30:130].shape)
    return image


def shadow(image: np.ndarray) -> np.ndarray:
    image = image.copy()
    image[50:] *= 0.7
    return image


def lamp(image: np.ndarray) -> np.ndarray:
    falloff = np.linspace(0.75, 1.0, WIDTH)[None, :, None]
    return np.where(falloff < 0.9, image * falloff, image)


@pytest.mark.parametrize("change", [lambda image: image, person, shadow], ids=["nothing", "a person", "a shadow"])
def test_the_gain_is_that_of_what_stands_still(change):
    still, later = frames(change=change)
    found = Exposure.of_frames(still).gains_of(later)
    np.testing.assert_allclose(found, np.tile(GAIN, (5, 1)), atol=0.002)


def test_a_lamp_that_dims_one_side_leaves_the_gain_within_a_percent():
    still, later = frames(change=lamp)
    np.testing.assert_allclose(Exposure.of_frames(still).gains_of(later).mean(0), GAIN, atol=0.01)


def test_white_says_nothing():
    def mostly_white(image):
        image = image.copy()
        image[:, 20:] = 2.0
        return image

    still = np.stack([taken(mostly_white(scene()), np.ones(3), seed) for seed in range(5)])
    later = np.stack([taken(mostly_white(scene()), GAIN, seed + 9) for seed in range(5)])
    np.testing.assert_allclose(Exposure.of_frames(still).gains_of(later).mean(0), GAIN, atol=0.004)


def test_a_step_within_the_frames_is_a_step():
    gains = np.where(np.arange(10) < 4, 1.0, 0.92)
    pictures = np.stack([taken(scene(), np.full(3, gain), i) for i, gain in enumerate(gains)])
    found = Exposure.of_frames(pictures).gains_of(pictures)
    np.testing.assert_allclose(found[4:] / found[:1], 0.92, atol=0.003)
    np.testing.assert_allclose(np.log(found).mean(0), 0.0, atol=0.002)  # against the mean of the clip


def test_frames_come_into_the_exposure_of_the_others():
    still, later = frames()
    corrected = Exposure.of_frames(still).applied_to(later).astype(np.float64)
    is_below_white = scene() < 0.85
    off = np.abs(corrected.mean(0) - still.mean(0))[is_below_white]
    assert off.mean() < 0.8  # noise of the mean of five frames twice, and rounding


def test_where_nothing_changes_nothing_is_done():
    still, later = frames(gain=np.ones(3), change=person)
    exposure = Exposure.of_frames(still)
    assert (exposure.gains_of(later) == 1.0).all()
    assert exposure.applied_to(later) is later


def test_the_smallest_changes_are_none_and_larger_ones_do_not_jump():
    logs = np.linspace(-0.02, 0.02, 4001)
    kept = np.log(without_noise(np.exp(logs)))
    assert (kept[np.abs(logs) <= NO_CHANGE] == 0).all()
    is_large = np.abs(logs) >= 2 * NO_CHANGE
    np.testing.assert_allclose(kept[is_large], logs[is_large], atol=1e-12)
    assert np.abs(np.diff(kept)).max() < 2.01 * (logs[1] - logs[0])


@pytest.mark.slow
@pytest.mark.parametrize("picture", [np.zeros((40, 60, 3)), np.full((40, 60, 3), 255.0)], ids=["black", "white"])
def test_pictures_that_cannot_tell_say_no_change(picture):
    look = at_working_size(taken(scene(), np.ones(3)))[:40, :60]
    assert (gain_of(picture.astype(np.float32), look) == 1.0).all()


def test_pictures_of_something_else_say_no_change_or_stay_within_bounds():
    rng = np.random.default_rng(5)
    look, other = (rng.uniform(0, 255, (90, 160, 3)).astype(np.float32) for _ in range(2))
    found = gain_of(other, look)
    assert np.isfinite(found).all()
    assert (np.abs(np.log(found)) < 0.8).all()


def test_the_curve_of_a_camera_is_undone():
    gain = np.array([0.9, 0.9, 0.9])
    still = np.stack([taken(scene(), np.ones(3), seed) for seed in range(3)])
    later = np.stack([np.floor(to_camera(scene(), gain) * 255 + 0.5).astype(np.uint8)] * 3)
    off = Exposure.of_frames(still).applied_to(later)[0].astype(float) - scene() * 255
    assert np.abs(off).max() < 3.0
