"""Growing, shrinking and flooding, against distances between all pairs."""

from __future__ import annotations

import numpy as np
import pytest

from engine.editing.selection.neighbours import flooded, grown, shrunk


def cloud(seed: int, n: int = 300) -> np.ndarray:
    """Clumps, so that there are gaps; two points in the same place. [n, 3] float32"""
    rng = np.random.default_rng(seed)
    points = rng.normal(0.0, 0.25, (n, 3)) + 1.5 * rng.integers(-2, 2, (n, 3))
    points[1] = points[0]
    return points.astype(np.float32)


def distances(points: np.ndarray) -> np.ndarray:
    points = points.astype(np.float64)
    return np.linalg.norm(points[:, None] - points[None], axis=2)


@pytest.mark.parametrize("distance", [0.05, 0.3, 1.2, 50.0])
@pytest.mark.parametrize("seed", [0, 1])
def test_grown_and_shrunk(seed: int, distance: float) -> None:
    points = cloud(seed)
    selected = np.random.default_rng(seed).random(len(points)) < 0.3
    away = distances(points)
    np.testing.assert_array_equal(
        grown(points, selected, distance), selected | (away[:, selected] <= distance).any(axis=1)
    )
    np.testing.assert_array_equal(
        shrunk(points, selected, distance), selected & ~(away[:, ~selected] <= distance).any(axis=1)
    )


@pytest.mark.parametrize("distance", [0.1, 0.35, 0.8])
@pytest.mark.parametrize("tolerance", [0.0, 0.3, 1.0])
def test_flooded(distance: float, tolerance: float) -> None:
    points = cloud(2)
    colors = np.random.default_rng(3).random((len(points), 3)).astype(np.float32)
    away, is_alike = distances(points), (np.abs(colors - colors[7]) <= tolerance).all(axis=1)
    truth = np.zeros(len(points), bool)
    truth[7] = True
    for _ in points:
        truth |= is_alike & (away[:, truth] <= distance).any(axis=1)
    np.testing.assert_array_equal(flooded(points, colors, 7, distance, tolerance), truth)


def test_a_gap_stops_a_flood_and_a_bridge_lets_it_through() -> None:
    line = np.zeros((21, 3), np.float32)
    line[:, 0] = np.arange(21)
    gray = np.full((21, 3), 0.5, np.float32)
    assert flooded(line, gray, 3, 1.0, 0.1).all()
    line[10:, 0] += 5.0
    assert np.flatnonzero(flooded(line, gray, 3, 1.0, 0.1)).tolist() == list(range(10))
    line[10:, 0] -= 5.0
    gray[10] = 1.0
    assert np.flatnonzero(flooded(line, gray, 3, 1.0, 0.1)).tolist() == list(range(10))


@pytest.mark.parametrize("distance", [0.0, -1.0, np.nan, np.inf])
def test_a_distance_that_is_none_changes_nothing(distance: float) -> None:
    points, selected = cloud(4), np.arange(300) < 9
    np.testing.assert_array_equal(grown(points, selected, distance), selected)
    np.testing.assert_array_equal(shrunk(points, selected, distance), selected)
    assert flooded(points, points, 5, distance, 9.0).sum() == 1


def test_what_is_not_finite_is_neither_reached_nor_a_bridge() -> None:
    points = np.array([[0, 0, 0], [np.nan, 0, 0], [0.1, 0, 0], [np.inf, 0, 0], [1e30, 0, 0]], np.float32)
    selected = np.array([True, False, False, True, False])
    assert grown(points, selected, 0.5).tolist() == [True, False, True, True, False]
    assert flooded(points, np.zeros((5, 3)), 0, 0.5, 1.0).tolist() == [True, False, True, False, False]
    assert not flooded(points, np.zeros((5, 3)), 1, 0.5, 1.0).any()
    colors = np.zeros((5, 3))
    colors[2] = np.nan
    assert flooded(points, colors, 0, 0.5, 1.0).sum() == 1
    with pytest.raises(ValueError, match="no Gaussian 5"):
        flooded(points, points, 5, 0.5, 1.0)
    assert len(grown(np.zeros((0, 3)), np.zeros(0, bool), 1.0)) == 0


def test_coordinates_far_from_the_origin_keep_their_neighbours() -> None:
    points = cloud(5).astype(np.float64) + 1e4
    selected = np.arange(300) < 30
    away = distances(points)
    np.testing.assert_array_equal(grown(points, selected, 0.3), selected | (away[:, selected] <= 0.3).any(axis=1))
