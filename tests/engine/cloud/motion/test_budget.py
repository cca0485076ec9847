"""Points chosen within a budget: nobody out of reach before the budget says so, what is there longest first."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.cloud.motion.budget import NOBODY, choose_within_budget


def lattice(seed: int, n_points: int) -> tuple[np.ndarray, np.ndarray]:
    """Different voxels of a small cube, and the frames of five in which they are there, at least one each."""
    rng = np.random.default_rng(seed)
    points = np.argwhere(np.ones((6, 6, 6)))[rng.permutation(216)[:n_points]].astype(np.float32)
    presence = rng.random((n_points, 5)) < 0.3
    presence[np.arange(n_points), rng.integers(0, 5, n_points)] = True
    return points, presence


@given(seed=st.integers(0, 10_000), n_points=st.integers(1, 216), budget=st.integers(0, 216))
@settings(max_examples=60, deadline=None)
def test_a_stand_in_is_the_nearest_chosen_point_within_reach(seed: int, n_points: int, budget: int) -> None:
    points, presence = lattice(seed, n_points)
    is_chosen, stand_in = choose_within_budget(points, presence, budget=budget, reach=1.05)
    assert is_chosen.sum() == min(budget, n_points)
    assert (stand_in[is_chosen] == np.flatnonzero(is_chosen)).all()
    distances = np.linalg.norm(points[:, None] - points[None], axis=2)
    distances[:, ~is_chosen] = np.inf
    nearest = distances.min(axis=1)
    assert ((stand_in != NOBODY) == (nearest <= 1.05)).all()
    has_one = stand_in != NOBODY
    assert (distances[has_one, stand_in[has_one]] == nearest[has_one]).all()


@given(seed=st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_every_point_is_within_reach_as_long_as_the_budget_allows(seed: int) -> None:
    points, presence = lattice(seed, 150)
    _, stand_in = choose_within_budget(points, presence, budget=149, reach=1.05)
    assert (stand_in != NOBODY).all()
    _, stand_in = choose_within_budget(points, presence, budget=75, reach=1.05)  # no two of the first are neighbours
    assert (stand_in != NOBODY).mean() > 0.95


def test_what_is_there_longest_comes_first() -> None:
    points = np.array([[0.0, 0, 0], [10, 0, 0], [20, 0, 0], [30, 0, 0]])
    presence = np.array([[1, 0, 0], [1, 1, 1], [1, 0, 0], [1, 1, 0]], bool)
    chosen = [np.flatnonzero(choose_within_budget(points, presence, budget=n, reach=1.0)[0]).tolist() for n in range(5)]
    assert chosen == [[], [1], [1, 3], [0, 1, 3], [0, 1, 2, 3]]  # of equal ones that which comes first in the cloud


def test_neighbors_come_after_all_that_is_out_of_reach() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [9, 0, 0]])
    presence = np.array([[1, 1, 1], [1, 1, 1], [1, 1, 1], [1, 0, 0]], bool)
    is_chosen, stand_in = choose_within_budget(points, presence, budget=2, reach=1.05)
    assert is_chosen.tolist() == [False, True, False, True]  # the middle one reaches both ends
    assert stand_in.tolist() == [1, 1, 1, 3]


@pytest.mark.parametrize("budget", [3, 4])
def test_a_budget_that_is_not_reached_changes_nothing(budget: int) -> None:
    points, presence = lattice(0, 3)
    is_chosen, stand_in = choose_within_budget(points, presence, budget=budget, reach=1.0)
    assert is_chosen.all()
    assert stand_in.tolist() == [0, 1, 2]
