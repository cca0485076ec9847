"""Squares of tiles against numpy."""

from __future__ import annotations

import numpy as np
import pytest

from engine.backends.cpu.step.tile_squares import tile_squares


@pytest.mark.parametrize(("height", "width"), [(1, 1), (32, 64), (70, 45)])
def test_squares_are_those_of_numpy(height, width):
    random = np.random.default_rng(0)
    image = random.random((height, width, 3), np.float32)
    truth = random.integers(0, 256, (height, width, 3), np.uint8)
    gain = np.array([0.9, 1.0, 1.1], np.float32)
    squares = (image.astype(np.float64) * gain - truth / 255) ** 2
    expected = [[squares[y : y + 32, x : x + 32].sum() for x in range(0, width, 32)] for y in range(0, height, 32)]
    assert np.allclose(tile_squares(image, truth, gain), expected, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("shapes", [((9, 8, 3), (8, 8, 3), (3,)), ((8, 8, 3), (8, 8, 3), (2,)), ((8, 8), (8, 8), (3,))])
def test_shapes_that_do_not_fit_are_named(shapes):
    image, truth, gain = shapes
    arrays = np.zeros(image, np.float32), np.zeros(truth, np.uint8), np.ones(gain, np.float32)
    with pytest.raises(ValueError, match=r"image .*truth .*gain"):
        tile_squares(*arrays)
