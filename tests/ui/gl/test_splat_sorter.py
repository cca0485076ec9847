"""The depth order is exact, and the thread serves the newest request. No GL."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as st_numpy

from ui.gl import splat_sorter
from ui.gl.splat_sorter import SplatSorter, depth_order

VIEW_ROW = np.array([0.0, 0.0, 1.0, 0.0])
DEADLINE_S = 20.0


@pytest.fixture
def sorter() -> Iterator[SplatSorter]:
    sorter = SplatSorter()
    yield sorter
    sorter.release()


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


def test_thread_gives_the_same_order(sorter: SplatSorter, rng: np.random.Generator) -> None:
    means = rng.normal(size=(1000, 3)).astype(np.float32)
    row = np.array([0.6, 0.0, 0.8, 3.0])
    sorter.request("a", means, row, 0.01)
    order = sorter.wait(DEADLINE_S)
    assert order is not None
    assert order.key == "a"
    np.testing.assert_array_equal(order.ids, depth_order(means, row, 0.01))


def test_newest_request_replaces_one_that_has_not_begun(sorter: SplatSorter, monkeypatch: pytest.MonkeyPatch) -> None:
    has_begun, may_go_on, sorted_nears = threading.Event(), threading.Event(), []

    def slow_order(means: np.ndarray, view_row: np.ndarray, near: float) -> np.ndarray:
        sorted_nears.append(near)
        has_begun.set()
        assert may_go_on.wait(DEADLINE_S)
        return depth_order(means, view_row, near)

    monkeypatch.setattr(splat_sorter, "depth_order", slow_order)
    means = points_at([1.0, 2.0])
    sorter.request("first", means, VIEW_ROW, 0.1)
    assert has_begun.wait(DEADLINE_S)
    sorter.request("second", means, VIEW_ROW, 0.2)
    sorter.request("third", means, VIEW_ROW, 0.3)
    assert sorter.latest() is None
    assert sorter.is_busy
    may_go_on.set()
    order = sorter.wait(DEADLINE_S)
    assert order is not None
    assert order.key == "third"
    assert sorted_nears == [0.1, 0.3]
    assert not sorter.is_busy


def test_failed_sort_is_raised_to_whoever_asks_and_the_thread_lives_on(sorter: SplatSorter) -> None:
    sorter.request("bad", np.zeros((3, 2), dtype=np.float32), VIEW_ROW, 0.1)
    with pytest.raises(ValueError, match="matmul"):
        sorter.wait(DEADLINE_S)
    sorter.request("good", points_at([1.0]), VIEW_ROW, 0.1)
    order = sorter.wait(DEADLINE_S)
    assert order is not None
    assert order.key == "good"


def test_released_sorter_ends_its_thread_and_refuses_requests(sorter: SplatSorter) -> None:
    sorter.request("a", points_at([1.0]), VIEW_ROW, 0.1)
    sorter.wait(DEADLINE_S)
    sorter.release()
    assert not [thread for thread in threading.enumerate() if thread.name == "splat-sorter"]
    with pytest.raises(RuntimeError, match="release"):
        sorter.request("b", points_at([1.0]), VIEW_ROW, 0.1)
