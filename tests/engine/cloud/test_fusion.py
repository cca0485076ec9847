"""Fusing samples of several trusts: better ones win, points come to lie on the surface."""

import numpy as np
import pytest

from engine.cloud.fusion import TIER_DISTANCES, Samples, fuse_tiers, project_to_planes

SPACING = 0.1


def plane(rng, n: int, *, noise: float = 0.0, low: float = 0.0, high: float = 1.0, grey: float = 0.5) -> Samples:
    """Samples of the plane z = 0."""
    points = np.column_stack([rng.uniform(low, high, (n, 2)), rng.normal(0, noise, n)])
    return Samples(points, np.tile([0.0, 0.0, 1.0], (n, 1)), np.full((n, 3), grey))


NOTHING = Samples(*(np.zeros((0, 3)) for _ in range(3)))


def test_a_noisy_plane_becomes_flat_with_about_a_point_per_voxel(rng):
    noisy = plane(rng, 5000, noise=0.02)
    points, normals, _ = fuse_tiers([noisy, NOTHING, NOTHING], SPACING)
    assert np.abs(points[:, 2]).mean() < 0.25 * np.abs(noisy.points[:, 2]).mean()
    assert 80 <= len(points) <= 250
    assert np.allclose(np.linalg.norm(normals, axis=1), 1.0)
    assert normals[:, 2].min() > 0.99


def test_a_lower_tier_only_fills_what_better_ones_leave_open(rng):
    agreed = plane(rng, 3000, high=0.5, grey=0.2)
    filled = plane(rng, 6000, grey=0.8)
    points, _, colors = fuse_tiers([agreed, filled, NOTHING], SPACING)
    is_filled = colors[:, 0] > 0.5
    assert is_filled.any()
    distances = np.linalg.norm(np.maximum(points[is_filled, :2] - 0.5, 0.0), axis=1)  # to the square of the agreed ones
    assert distances.min() > 0.5 * TIER_DISTANCES[1] * SPACING
    is_covered = (points[:, :2] < 0.4).all(1)
    assert np.allclose(colors[is_covered], 0.2)


def test_nothing_gives_nothing():
    points, normals, colors = fuse_tiers([NOTHING] * 3, SPACING)
    assert points.shape == normals.shape == colors.shape == (0, 3)


def test_points_move_along_the_normal_only(rng):
    noisy = plane(rng, 500, noise=0.02)
    points, planes = project_to_planes(noisy.points, noisy.normals, np.ones(500), radius=0.3)
    assert np.allclose(points[:, :2], noisy.points[:, :2])
    assert np.abs(points[:, 2]).std() < np.abs(noisy.points[:, 2]).std()
    assert np.allclose(planes, [0.0, 0.0, 1.0])


def test_a_heavy_point_pulls_its_neighbours_to_itself():
    points = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 1.0]])
    normals = np.tile([0.0, 0.0, 1.0], (2, 1))
    moved, _ = project_to_planes(points, normals, np.array([1000.0, 1.0]), radius=10.0)
    assert moved[1, 2] == pytest.approx(0.0, abs=0.01)
    assert moved[0, 2] == pytest.approx(0.0, abs=0.01)
