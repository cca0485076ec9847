"""The depth order is exact. No GL."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as st_numpy

from ui.gl.depth_order import depth_order

VIEW_ROW = np.array([0.0, 0.0, 1.0, 0.0])


def points_at(depths: list[float] | np.ndarray) -> np.ndarray:
    points = np.zeros((len(depths), 3), dtype=np.float32)
    points[:, 2] = depths
    return points


def test_farthest_comes_first() -> None:
    assert depth_order(points_at([2.0, 5.0, 1.0]), VIEW_ROW, 0.01).tolist() == [1, 0, 2]


def test_equal_depths_are_the_reverse_of_the_row_order() -> None:
    assert depth_order(points_at([2.0, 2.0, 1.0, 2.0]), VIEW_ROW, 0.01).tolist() == [3, 1, 0, 2]


def test_rows_at_or_before_the_near_plane_are_left_out() -> None:
    assert depth_order(points_at([-3.0, 0.0, 0.5, 0.500001, 9.0]), VIEW_ROW, 0.5).tolist() == [4, 3]


def test_empty_set_has_an_empty_order() -> None:
    order = depth_order(points_at([]), VIEW_ROW, 0.01)
    assert order.shape == (0,)
    assert order.dtype == np.uint32


def test_view_row_is_applied_with_its_offset() -> None:
    means = np.array([[1, 0, 0], [2, 0, 0], [3, 0, 0]], dtype=np.float32)
    assert depth_order(means, np.array([-1.0, 0, 0, 2.5]), 0.01).tolist() == [0, 1]


@given(depths=st_numpy.arrays(np.float32, st.integers(0, 60), elements=st.floats(-2.0, 2.0**60, width=32)))
def test_order_equals_a_stable_sort_reversed(depths: np.ndarray) -> None:
    visible = np.flatnonzero(depths > np.float32(0.25))
    expected = visible[np.argsort(depths[visible], kind="stable")][::-1]
    assert depth_order(points_at(depths), VIEW_ROW, 0.25).tolist() == expected.tolist()


def test_neighbours_are_told_apart_from_very_far_away() -> None:
    """An orthographic view stands ten thousand scene radii away, where float32 depths come in coarse steps."""
    order = np.random.default_rng(2).permutation(500)
    means = np.zeros((500, 3), np.float32)
    means[:, 2] = 1e-4 * order
    ids = depth_order(means, np.array([0.0, 0.0, 1.0, 10_000.0]), 9_999.0)
    assert np.array_equal(order[ids], np.arange(500)[::-1])
