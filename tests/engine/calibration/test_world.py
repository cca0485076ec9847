"""Up and size of a calibration's world."""

from __future__ import annotations

import numpy as np
import pytest

from engine.calibration.solving.cameras import rotation_of
from engine.calibration.solving.world import find_up, known_scale, unit_scale, upright
from tests.engine.calibration.made_rigs import make_seen


def turned_scene(*, has_floor: bool):
    """A ring over a floor (or nothing level), in a world that is turned, shrunk and moved."""
    seen = make_seen("ring")
    generator = np.random.default_rng(7)
    floor = np.concatenate([generator.uniform(-2, 2, (600, 2)), generator.normal(0, 0.005, (600, 1))], axis=1)
    points = np.concatenate([seen.points, floor]) if has_floor else seen.points
    turn = rotation_of(np.array([[0.7, -0.4, 1.9]]))[0]
    shift = np.array([3.0, -2.0, 5.0])
    return seen.truth.moved(0.3, turn, shift), 0.3 * points @ turn.T + shift, turn[:, 2]


def test_up_is_away_from_the_floor_which_lies_at_zero() -> None:
    cameras, points, up = turned_scene(has_floor=True)
    found, origin, way = find_up(cameras, points, "floor")
    assert way == "floor"
    assert np.degrees(np.arccos(found @ up)) < 0.5
    moved, moved_points = upright(cameras, points, found, origin, 1 / 0.3)
    assert np.median(np.abs(moved_points[-600:, 2])) < 0.02
    np.testing.assert_allclose(np.sort(moved.centers[:, 2])[[0, -1]], [1.0, 1.8], atol=0.03)


def test_without_a_floor_up_is_where_the_cameras_have_their_upper_edge() -> None:
    cameras, points, up = turned_scene(has_floor=False)
    found, _, way = find_up(cameras, points, "floor")
    assert way == "cameras"
    assert np.degrees(np.arccos(found @ up)) < 3.0
    assert find_up(*turned_scene(has_floor=True)[:2], "cameras")[2] == "cameras"


def test_pixels_do_not_change_when_the_world_does() -> None:
    cameras, points, _ = turned_scene(has_floor=True)
    up, origin, _ = find_up(cameras, points, "floor")
    moved, moved_points = upright(cameras, points, up, origin, 2.5)
    rows = np.zeros(len(points), dtype=int)
    np.testing.assert_allclose(moved.pixels(rows, moved_points)[0], cameras.pixels(rows, points)[0], atol=1e-6)


def test_a_known_distance_is_that_distance() -> None:
    cameras, points, _ = turned_scene(has_floor=True)
    scale = known_scale(cameras, 0, 10, 5.4)
    moved = cameras.moved(scale, np.eye(3), np.zeros(3))
    assert np.linalg.norm(moved.centers[0] - moved.centers[10]) == pytest.approx(5.4)
    assert unit_scale(cameras, points) * 0.3 == pytest.approx(1.0, rel=0.2)
