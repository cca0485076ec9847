"""How near and how far cameras look: derived from the rig, and from sparse points where there are enough."""

import numpy as np
import pytest

from app.lab.synthetic.rigs import make_rig
from engine.camera.depth_range import (
    FOCUS_RANGE,
    MIN_POINTS,
    NEAR_SHARE,
    POINT_MARGINS,
    depth_ranges,
    focus_distances,
    near_plane,
)
from engine.camera.projection import unproject

RIG = make_rig(6, (80, 60))


def points_at(depth: float, n: int) -> np.ndarray:
    """Points in the middle of the first camera's picture."""
    cloud = unproject(np.full((60, 80), depth), RIG.Ks[0], RIG.world_to_camera[0])
    return cloud[20:40, 30:50].reshape(-1, 3)[:n]


def test_without_points_the_range_follows_each_cameras_distance_to_the_focus():
    near, far = depth_ranges(RIG, None)
    distances = focus_distances(RIG)
    assert np.allclose(near, FOCUS_RANGE[0] * distances)
    assert np.allclose(far, FOCUS_RANGE[1] * distances)
    assert near_plane(RIG) == pytest.approx(NEAR_SHARE * np.median(distances))


def test_a_camera_that_sees_enough_points_takes_their_depths():
    depth = 2.0
    near, far = depth_ranges(RIG, points_at(depth, MIN_POINTS))
    assert near[0] == pytest.approx(POINT_MARGINS[0] * depth)
    assert far[0] == pytest.approx(max(POINT_MARGINS[1] * depth, 1.5 * near[0]))


def test_too_few_points_say_nothing():
    without = depth_ranges(RIG, None)
    assert np.array_equal(depth_ranges(RIG, points_at(2.0, MIN_POINTS - 1)), without)
    assert np.array_equal(depth_ranges(RIG, np.zeros((0, 3))), without)


def test_points_in_front_of_the_lens_do_not_bring_the_near_plane_with_them():
    near, far = depth_ranges(RIG, points_at(0.01, 2 * MIN_POINTS))
    assert near[0] == near_plane(RIG)
    assert far[0] >= 1.5 * near[0]
