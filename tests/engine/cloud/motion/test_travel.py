"""Points that travel: with a ball that flies, around what turns, and where surfaces come and go."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial import KDTree

from engine.cloud.motion.travel import COVER_SPACINGS, MOST_FRAMES, STRAY_SPACINGS, Travellers, follow

SPACING = 0.05


def ball(radius: float = 0.4, spacing: float = SPACING) -> np.ndarray:
    """Voxels around a sphere's surface. [S, 3]"""
    side = np.arange(-radius - spacing, radius + 2 * spacing, spacing)
    grid = np.stack(np.meshgrid(side, side, side), axis=-1).reshape(-1, 3)
    return grid[np.abs(np.linalg.norm(grid, axis=1) - radius) < 0.6 * spacing]


def along(velocity: np.ndarray, acceleration: np.ndarray, n_frames: int) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Surfaces and steps of a ball on a parabola."""
    places = [frame * velocity + frame**2 * acceleration for frame in range(n_frames)]
    surfaces = [ball() + place for place in places]
    moves = [np.broadcast_to(after - before, (len(ball()), 3)) for before, after in pairwise(places)]
    return surfaces, moves


def covers(found: Travellers, surfaces: list[np.ndarray]) -> bool:
    """Whether every surface point of every frame has a traveller next to it."""
    reach = COVER_SPACINGS * SPACING
    here = [found.at(frame)[found.presence[:, frame]] for frame in range(len(surfaces))]
    return all((KDTree(near).query(surface)[0] <= reach).all() for near, surface in zip(here, surfaces, strict=True))


def test_a_ball_on_a_parabola_is_the_same_points_in_all_frames():
    velocity, acceleration = np.array([0.06, -0.02, 0.01]), np.array([0.0, 0.0, -0.004])
    surfaces, steps = along(velocity, acceleration, 10)
    found = follow(surfaces, steps, SPACING)
    assert len(found.points) == len(ball())
    assert found.presence.all()
    assert set(found.birth_frames) == {5}
    np.testing.assert_array_equal(found.points, surfaces[5])
    # the fit leans a little towards no acceleration, so that one frame alone says nothing of it
    np.testing.assert_allclose(found.accelerations, np.tile(acceleration, (len(found.points), 1)), atol=1e-4)
    np.testing.assert_allclose(found.at(0), surfaces[0], atol=0.1 * SPACING)
    assert covers(found, surfaces)


def test_one_point_where_nothing_stirs_and_a_point_a_frame_where_nobody_can_tell():
    still = follow([ball()] * 4, [np.zeros((len(ball()), 3))] * 3, SPACING)
    assert len(still.points) == len(ball())
    assert not still.velocities.any()
    surfaces, _ = along(np.array([1.0, 0.0, 0.0]), np.zeros(3), 4)  # leaps farther than it is wide
    lost = follow(surfaces, [np.zeros((len(ball()), 3))] * 3, SPACING)
    assert len(lost.points) == 4 * len(ball())
    assert (lost.presence.sum(1) == 1).all()
    assert covers(lost, surfaces)


def test_what_appears_begins_then_and_what_disappears_ends():
    other = ball() + np.array([3.0, 0.0, 0.0])
    surfaces = [np.concatenate([ball(), other]) if frame >= 3 else ball() for frame in range(5)]
    found = follow(surfaces, [np.zeros((len(surface), 3)) for surface in surfaces[:-1]], SPACING)
    late = found.points[:, 0] > 2.0
    assert late.sum() == len(other)
    assert (found.presence[late] == [False, False, False, True, True]).all()
    assert found.presence[~late].all()
    assert covers(found, surfaces)


def test_towards_the_middle_nobody_is_followed_twice():
    surfaces, steps = along(np.array([0.5, 0.0, 0.0]), np.zeros(3), 9)
    lost = [np.zeros_like(step) for step in steps]
    found = follow(surfaces, lost, SPACING)
    early, late = found.birth_frames < 4, found.birth_frames > 4
    assert early.any()
    assert late.any()
    assert not found.presence[early, 4:].any()
    assert not found.presence[late, :5].any()


def test_a_path_ends_after_so_many_frames():
    n_frames = 3 * MOST_FRAMES
    found = follow([ball()] * n_frames, [np.zeros((len(ball()), 3))] * (n_frames - 1), SPACING)
    assert found.presence.sum(1).max() == 2 * MOST_FRAMES + 1
    assert covers(found, [ball()] * n_frames)


@pytest.mark.parametrize("where", [[], [0], [2], [0, 1, 2, 3, 4]])
def test_frames_without_anything(where):
    surfaces = [ball()[:0] if frame in where else ball() for frame in range(5)]
    found = follow(surfaces, [np.zeros((len(surface), 3)) for surface in surfaces[:-1]], SPACING)
    assert not found.presence[:, where].any()
    assert np.isfinite(found.velocities).all()
    assert covers(found, [surface for surface in surfaces]) or where


def test_one_other_frame_gives_a_velocity_alone():
    surfaces, steps = along(np.array([0.04, 0.0, 0.0]), np.zeros(3), 2)
    found = follow(surfaces, steps, SPACING)
    assert np.abs(found.accelerations).max() < 1e-12
    assert STRAY_SPACINGS > COVER_SPACINGS
    np.testing.assert_allclose(found.velocities[:, 0], 0.04, rtol=1e-9)


def test_a_single_frame():
    found = follow([ball()], [], SPACING)
    assert found.presence.shape == (len(ball()), 1)
    assert not found.velocities.any()
