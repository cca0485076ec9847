"""Depth maps are completed by the smoothest surface through what is known."""

import numpy as np
import pytest

from engine.cloud.stereo.depth.fill import fill_inverse_depth

HEIGHT, WIDTH = 24, 32
SLOPE = np.broadcast_to(np.linspace(0.2, 0.8, WIDTH), (HEIGHT, WIDTH))
"""A tilted wall: a plane in space is one in inverse depth."""
FLAT = np.full((HEIGHT, WIDTH), 128.0)


def fill(inverse_depth, weights, grey=FLAT, *, low=0.0, high=1.0):
    return fill_inverse_depth(inverse_depth, weights, grey, low=low, high=high)


def test_a_tilted_wall_goes_on_through_a_hole():
    weights = np.ones((HEIGHT, WIDTH))
    weights[:, 10:22] = 0.0
    filled = fill(np.where(weights > 0, SLOPE, 9.0), weights)
    assert np.abs(filled - SLOPE)[2:-2, 2:-2].max() < 0.02


def test_a_single_wrong_value_is_outvoted_by_its_surroundings():
    spoiled = SLOPE.copy()
    spoiled[10:12, 14:16] = 1.0
    weights = np.full((HEIGHT, WIDTH), 0.5)
    error = np.abs(fill(spoiled, weights) - SLOPE)[10:12, 14:16].max()
    assert error < 0.5 * (1.0 - SLOPE[10, 15])


def test_a_step_stays_sharp_where_the_picture_has_an_edge():
    step = np.where(np.arange(WIDTH) < 16, 0.3, 0.7) * np.ones((HEIGHT, 1))
    weights = np.zeros((HEIGHT, WIDTH))
    weights[:, :8] = weights[:, -8:] = 1.0
    edge = np.where(np.arange(WIDTH) < 16, 60.0, 200.0) * np.ones((HEIGHT, 1))
    with_edge, without = (np.abs(fill(step, weights, grey) - step).mean() for grey in (edge, FLAT))
    assert with_edge < 0.75 * without


def test_results_stay_within_their_limits():
    filled = fill(SLOPE, np.ones((HEIGHT, WIDTH)), low=0.4, high=0.6)
    assert filled.min() == pytest.approx(0.4)
    assert filled.max() == pytest.approx(0.6)


def test_without_data_it_is_the_middle():
    assert np.allclose(fill(SLOPE, np.zeros((HEIGHT, WIDTH)), low=0.2, high=0.4), 0.3)
