"""Exact union of spheres against brute force, and cases where the nearest centre gives the wrong answer."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.cloud.motion.dedup import mean_neighbor_distance, residual_rows, union_distance


def union_distance_reference(points: np.ndarray, centers: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """The definition, all pairs."""
    distances = np.linalg.norm(points[:, None] - centers[None], axis=2) - radii[None]
    return distances.min(axis=1)


@given(seed=st.integers(0, 10_000), n_centers=st.integers(1, 200), spread=st.floats(0.0, 3.0))
@settings(max_examples=40, deadline=None)
def test_union_distance_is_exact(seed: int, n_centers: int, spread: float) -> None:
    rng = np.random.default_rng(seed)
    centers, points = rng.normal(size=(n_centers, 3)), 2.0 * rng.normal(size=(60, 3))
    radii = 0.05 * np.exp(spread * rng.normal(size=n_centers))
    expected = union_distance_reference(points, centers, radii)
    # both take square roots of sums of three squares of numbers below 100: a few float64 ulps
    assert np.allclose(union_distance(points, centers, radii), expected, rtol=0, atol=1e-12)


def test_a_far_large_sphere_covers_what_the_nearest_small_one_does_not() -> None:
    centers = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
    radii = np.array([0.1, 2.9])
    point = np.array([[0.5, 0.0, 0.0]])
    assert union_distance(point, centers, radii)[0] == pytest.approx(-0.4)
    assert not residual_rows(point, centers, radii)[0]
    assert residual_rows(point, centers[:1], radii[:1])[0]


def test_tolerance_asks_for_distance_from_the_union() -> None:
    centers, radii = np.zeros((1, 3)), np.array([1.0])
    points = np.array([[1.05, 0.0, 0.0], [1.2, 0.0, 0.0]])
    assert residual_rows(points, centers, radii).tolist() == [True, True]
    assert residual_rows(points, centers, radii, tolerance=0.1).tolist() == [False, True]


def test_without_spheres_everything_is_residual() -> None:
    assert residual_rows(np.zeros((3, 3)), np.zeros((0, 3)), np.zeros(0)).all()
    assert residual_rows(np.zeros((0, 3)), np.zeros((1, 3)), np.ones(1)).shape == (0,)


def test_bad_radii_are_refused() -> None:
    with pytest.raises(ValueError, match="finite"):
        union_distance(np.zeros((1, 3)), np.zeros((1, 3)), np.array([np.nan]))
    with pytest.raises(ValueError, match="radii"):
        union_distance(np.zeros((1, 3)), np.zeros((2, 3)), np.ones(1))


def test_mean_neighbor_distance_on_a_line() -> None:
    points = np.stack([np.arange(5.0), np.zeros(5), np.zeros(5)], axis=1)
    assert np.allclose(mean_neighbor_distance(points, k=2), [1.5, 1.0, 1.0, 1.0, 1.5])
    assert mean_neighbor_distance(points[:1]).tolist() == [0.0]
    assert np.allclose(mean_neighbor_distance(points[:2], k=3), 1.0)
