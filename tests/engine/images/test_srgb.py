"""The curve of sRGB: known values, and there and back."""

import numpy as np

from engine.images.srgb import encoded_of, linear_of


def test_known_levels() -> None:
    """IEC 61966-2-1: middle grey of a display reflects 21.4 % of the light."""
    encoded = np.array([0.0, 0.04045, 0.5, 1.0])
    np.testing.assert_allclose(linear_of(encoded), [0.0, 0.0031308, 0.2140411, 1.0], atol=1e-6)


def test_there_and_back() -> None:
    levels = np.linspace(0.0, 1.5, 301)
    np.testing.assert_allclose(encoded_of(linear_of(levels)), levels, atol=1e-4)
    assert linear_of(np.array([0.5], np.float32)).dtype == np.float32
