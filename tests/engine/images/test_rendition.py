"""Renditions against the formula pixel by pixel, at any size of the picture, and there and back."""

import numpy as np
import pytest

from engine.images.exposure_curve import KNEE, to_camera, to_reference
from engine.images.rendition import Rendition, log_rims, typical_vignetting

LENS = Rendition((1.1, 0.9, 1.0), (-0.4, 0.1), (0.48, 0.55))


def slow_falloff(seen: Rendition, width: int, height: int) -> np.ndarray:
    """Pixel by pixel. [H, W]"""
    found = np.empty((height, width))
    for y in range(height):
        for x in range(width):
            dx, dy = x + 0.5 - seen.center[0] * width, y + 0.5 - seen.center[1] * height
            squared = (dx * dx + dy * dy) / (0.25 * (width**2 + height**2))
            found[y, x] = np.exp(seen.vignetting[0] * squared + seen.vignetting[1] * squared**2)
    return found


@pytest.mark.parametrize(("width", "height"), [(64, 36), (31, 48), (1, 1)])
def test_falloff_is_the_formula(width: int, height: int):
    found = LENS.falloff(width, height)
    assert found is not None
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, slow_falloff(LENS, width, height), rtol=2e-6)  # rounding of float32


def test_a_smaller_picture_has_the_same_falloff():
    large, small = LENS.falloff(128, 72), LENS.falloff(32, 18)
    assert large is not None
    assert small is not None
    blocks = large.reshape(18, 4, 32, 4).mean((1, 3))
    np.testing.assert_allclose(blocks, small, atol=2e-4)  # a mean over pixels against its middle


def test_below_the_knee_it_is_gain_times_falloff():
    scene = np.random.default_rng(0).random((36, 64, 3)).astype(np.float32) * 0.8
    expected = scene * np.array(LENS.gain) * slow_falloff(LENS, 64, 36)[..., None]
    np.testing.assert_allclose(LENS.to_camera(scene), expected, atol=1e-6)


def test_a_picture_comes_back_as_it_was():
    scene = np.random.default_rng(1).random((36, 64, 3)) * 0.8
    pixels = np.floor(np.clip(LENS.to_camera(scene), 0, 1) * 255 + 0.5).astype(np.uint8)
    # half a level of each rounding, the first one divided by the smallest factor, and the steps of the falloff
    smallest = 0.9 * slow_falloff(LENS, 64, 36).min()
    assert np.abs(LENS.to_scene(pixels) / 255.0 - scene).max() <= (0.5 / smallest + 0.5) / 255 + 0.5 / 400


def test_white_stays_white_at_the_rim():
    white = np.full((36, 64, 3), 255, np.uint8)
    assert (LENS.to_scene(white) == 255).all()
    np.testing.assert_allclose(LENS.to_camera(white / np.float32(255)), 1.0, atol=1e-6)


def test_one_falloff_for_all_pixels_is_a_gain():
    pixels = np.arange(768, dtype=np.uint32).astype(np.uint8).reshape(16, 16, 3)
    even = np.full((16, 16), np.exp(-40 / 400), np.float32)  # a whole number of steps
    gain = np.full(3, np.exp(-40 / 400))
    assert np.array_equal(to_reference(pixels, np.ones(3), even), to_reference(pixels, gain))
    image = pixels / 255.0 * KNEE
    np.testing.assert_allclose(to_camera(image, np.ones(3), even), to_camera(image, gain), rtol=1e-6)


def test_without_gain_and_vignetting_it_is_plain():
    plain = Rendition.of(np.ones(3, np.float32), np.zeros(2, np.float32), np.eye(3), (64, 36))
    pixels = np.zeros((36, 64, 3), np.uint8)
    assert plain.is_plain
    assert plain.to_scene(pixels) is pixels
    assert not Rendition.of(np.ones(3), np.array([-0.1, 0.0]), np.eye(3), (64, 36)).is_plain


def test_the_typical_lens_is_the_median_by_its_rim():
    lenses = np.array([[0.0, 0.0], [-0.4, 0.2], [-0.1, 0.0]], np.float32)
    assert np.argsort(log_rims(lenses)).tolist() == [1, 2, 0]
    assert np.array_equal(typical_vignetting(lenses), lenses[2])
