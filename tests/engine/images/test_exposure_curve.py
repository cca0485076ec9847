"""Pictures into another exposure and back: plain factors below the knee, white stays white, nothing falls behind."""

import numpy as np
import pytest

from engine.images.exposure_curve import KNEE, to_camera, to_reference

GAINS = [(0.9, 1.05, 1.0), (0.5, 2.0, 0.97), (1.2, 0.2, 1.001)]


def colors(n: int = 4000, seed: int = 3) -> np.ndarray:
    return np.random.default_rng(seed).random((n, 1, 3))


@pytest.mark.parametrize("gain", GAINS)
def test_a_picture_comes_back_as_it_was(gain):
    gain, scene = np.array(gain), colors()
    pixels = np.floor(to_camera(scene, gain) * 255 + 0.5).astype(np.uint8)
    off = np.abs(to_reference(pixels, gain) / 255.0 - scene)
    # rounding of the camera's levels, stretched where the curve is steepest, and of the result
    steepest = np.maximum(1 / gain, np.maximum((1 - KNEE) / (1 - KNEE * np.minimum(gain, 1)), 1.0))
    steepest = np.maximum(steepest, (1 - KNEE * np.minimum(gain, 1) / gain) / (1 - KNEE * np.minimum(gain, 1)))
    assert (off.max((0, 1)) <= (0.5 * steepest + 0.5 + 1e-6) / 255).all()


def test_below_the_knee_a_gain_is_a_factor():
    scene, gain = colors() * 0.85, np.array([0.9, 0.95, 1.0])
    np.testing.assert_allclose(to_camera(scene, gain), scene * gain, atol=1e-12)


@pytest.mark.parametrize("gain", GAINS)
def test_white_stays_white_and_order_is_kept(gain):
    levels = np.repeat(np.arange(256, dtype=np.uint8)[:, None, None], 3, axis=2)
    made = to_reference(levels, np.array(gain)).astype(int)[:, 0]
    assert (made[0] == 0).all()
    assert (made[-1] == 255).all()
    assert (np.diff(made, axis=0) >= 0).all()


def test_no_change_gives_the_picture_itself():
    pixels, image = np.zeros((2, 2, 3), np.uint8), np.zeros((2, 2, 3), np.float32)
    assert to_reference(pixels, np.ones(3, np.float32)) is pixels
    assert to_camera(image, np.ones(3, np.float32)) is image


def test_what_shines_beyond_white_does_so_afterwards():
    image = np.full((1, 1, 3), 1.25, np.float32)
    np.testing.assert_allclose(to_camera(image, np.array([0.8, 1.1, 0.5])), 1.25, rtol=1e-6)
    assert to_camera(image, np.array([0.8, 1.1, 0.5])).dtype == np.float32
