"""Shapes over a picture, against slow truths pixel by pixel."""

from __future__ import annotations

import math

import numpy as np
import pytest

from engine.editing.selection.shapes import MAX_POINTS, brush_mask, lasso_mask, rectangle_mask

SIZE = (40, 30)


def winding(corners: np.ndarray, x: float, y: float) -> int:
    """How often a closed polygon goes around a point, as the sum of the angles under which its edges are seen."""
    total = 0.0
    for i in range(len(corners)):
        (ax, ay), (bx, by) = corners[i] - [x, y], corners[(i + 1) % len(corners)] - [x, y]
        total += math.atan2(ax * by - ay * bx, ax * bx + ay * by)
    return round(total / (2.0 * math.pi))


def slow_lasso(corners: np.ndarray) -> np.ndarray:
    return np.array([[winding(corners, x + 0.5, y + 0.5) != 0 for x in range(SIZE[0])] for y in range(SIZE[1])])


@pytest.mark.parametrize("seed", range(6))
def test_a_lasso_however_it_crosses_itself(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-10.0, 50.0, (int(rng.integers(3, 12)), 2))
    truth = slow_lasso(corners)
    assert truth.any()
    np.testing.assert_array_equal(lasso_mask(corners, SIZE), truth)


def test_both_loops_of_an_eight_and_what_is_gone_around_twice_are_inside() -> None:
    eight = np.array([[5, 5], [35, 25], [35, 5], [5, 25]], float)
    mask = lasso_mask(eight, SIZE)
    assert mask[15, 8]
    assert mask[15, 31]
    assert not mask[6, 20]
    assert not mask[24, 20]
    angles = np.linspace(0.0, 4.0 * math.pi, 60)  # twice around
    twice = np.stack([20 + (8 + angles / 4) * np.cos(angles), 15 + (8 + angles / 4) * np.sin(angles)], axis=1)
    assert lasso_mask(twice, SIZE)[15, 20]


@pytest.mark.parametrize(
    "corners",
    [np.zeros((0, 2)), [[3, 3]], [[3, 3], [30, 20]], [[3, 3]] * 5, [[3, 3], [10, 10], [20, 20]], [[np.nan, 1]] * 4],
    ids=["none", "a point", "a line", "one point often", "three on a line", "not numbers"],
)
def test_a_lasso_without_an_inside_holds_nothing(corners: list[list[float]]) -> None:
    assert not lasso_mask(np.array(corners), SIZE).any()


def test_a_lasso_far_beyond_the_picture_holds_all_of_it() -> None:
    far = np.array([[-1e30, -1e30], [1e30, -1e30], [1e30, 1e30], [-1e30, 1e30]])
    assert lasso_mask(far, SIZE).all()
    circle = np.linspace(0.0, 2.0 * math.pi, 3 * MAX_POINTS)
    many = np.stack([20 + 12 * np.cos(circle), 15 + 12 * np.sin(circle)], axis=1)
    np.testing.assert_array_equal(lasso_mask(many, SIZE), lasso_mask(many[::100], SIZE))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_a_brush_is_a_disc_along_a_line(seed: int) -> None:
    rng = np.random.default_rng(seed)
    line, radius = rng.uniform(-8.0, 45.0, (int(rng.integers(1, 6)), 2)), float(rng.uniform(0.8, 9.0))
    dense = np.concatenate([np.linspace(a, b, 4000) for a, b in zip(line, [*line[1:], line[-1]], strict=True)])
    pixels = np.stack(np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5), axis=2)
    away = np.array([[np.hypot(*(dense - pixel).T).min() for pixel in row] for row in pixels])
    mask = brush_mask(line, radius, SIZE)
    assert mask[away < radius - 0.02].all()
    assert not mask[away > radius + 0.02].any()


def test_a_brush_without_a_size_or_a_place_paints_nothing() -> None:
    for points, radius in (([[5.0, 5.0]], 0.0), ([[5.0, 5.0]], np.nan), ([], 3.0), ([[np.inf, 5.0]], 3.0)):
        assert not brush_mask(np.array(points), radius, SIZE).any()
    assert brush_mask(np.array([[5.5, 5.5]]), 0.1, SIZE).sum() == 1


def test_a_rectangle_between_any_two_corners() -> None:
    mask = rectangle_mask(30.0, 20.2, 10.5, -5.0, SIZE)
    truth = np.zeros((30, 40), bool)
    truth[:20, 10:30] = True
    np.testing.assert_array_equal(mask, truth)
    np.testing.assert_array_equal(mask, rectangle_mask(10.5, -5.0, 30.0, 20.2, SIZE))
    assert not rectangle_mask(np.nan, 0.0, 30.0, 20.0, SIZE).any()
    assert not rectangle_mask(-9.0, -9.0, -1.0, -1.0, SIZE).any()
    assert rectangle_mask(-1e9, -1e9, 1e9, 1e9, SIZE).all()
