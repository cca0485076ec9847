"""Colours without the cameras' gains, and thresholds from a picture's own noise."""

import numpy as np
import pytest

from engine.cloud.background.gains import scene_colors
from engine.cloud.background.masks import MIN_THRESHOLD, NOISE_FACTOR, noise_threshold


def test_what_cameras_saw_comes_back_without_their_gains(rng):
    colors = rng.uniform(20.0, 200.0, (30, 3))
    gains = rng.uniform(0.8, 1.2, (5, 3))
    seen = np.log((colors + 1.0) * gains[:, None])
    seen[0, :10] = np.nan
    assert np.allclose(scene_colors(seen, gains), colors, rtol=1e-5)


def test_a_camera_that_sees_something_else_is_outvoted_and_what_nobody_sees_is_unknown():
    seen = np.log(np.full((3, 2, 3), 101.0))
    seen[0] = np.log(251.0)
    seen[:, 1] = np.nan
    found = scene_colors(seen, np.ones((3, 3)))
    assert found[0] == pytest.approx([100.0] * 3)
    assert np.isnan(found[1]).all()


def test_the_threshold_follows_the_noise_while_less_than_half_of_the_picture_moves():
    difference = np.full((40, 40), 10.0)
    difference[:15] = 700.0
    assert noise_threshold(difference) == NOISE_FACTOR * 10.0
    assert noise_threshold(np.zeros((40, 40))) == MIN_THRESHOLD
