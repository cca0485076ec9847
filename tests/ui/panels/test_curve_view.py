"""What part of curves is shown: zoom and pan stay inside, values are those nearest to the pointer."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ui.panels.training.curve_view import MAX_CHOSEN, MIN_SPAN, CurveView, value_at, value_range


@given(
    moves=st.lists(st.tuples(st.booleans(), st.floats(-5, 5), st.floats(0, 1)), max_size=12),
    last=st.floats(10, 1e6),
)
def test_what_is_shown_stays_inside_whatever_is_turned(moves, last: float) -> None:
    view = CurveView()
    for is_zoom, amount, share in moves:
        low, high = view.limits(last)
        if is_zoom:
            view.zoom(amount, low + share * (high - low), last)
        else:
            view.pan(amount * (high - low), last)
        low, high = view.limits(last)
        assert -1e-6 * last <= low < high <= last * (1 + 1e-6)
        assert high - low >= MIN_SPAN * (1 - 1e-6)


def test_the_step_under_the_pointer_stays_there() -> None:
    view = CurveView()
    view.zoom(2.0, 300.0, 1000.0)
    low, high = view.limits(1000.0)
    assert (300.0 - low) / (high - low) == 0.3
    view.zoom(-9.0, 300.0, 1000.0)
    assert view.span is None, "everything is shown again"


def test_clips_are_chosen_and_the_first_gives_way() -> None:
    view = CurveView()
    assert view.shown(3, 10) == [3]
    assert view.shown(None, 10) == []
    for index in range(MAX_CHOSEN + 1):
        view.toggle(index)
    assert view.chosen == [1, 2, 3, 4, 5, 6]
    view.toggle(4)
    assert view.shown(9, 6) == [1, 2, 3, 5], "clips that another project does not have are left out"


def test_values_are_those_of_the_nearest_step() -> None:
    steps, values = np.array([0.0, 10.0, 30.0]), np.array([5.0, 4.0, 3.0])
    found = [value_at(steps, values, at) for at in (-5.0, 4.0, 6.0, 19.0, 21.0, 99.0)]
    assert found == [(0, 5.0), (0, 5.0), (10, 4.0), (10, 4.0), (30, 3.0), (30, 3.0)]
    assert value_at(steps[:1], values[:1], 7.0) == (0, 5.0)
    assert value_at(steps[:0], values[:0], 7.0) is None


def test_the_range_is_that_of_what_is_seen() -> None:
    steps, values = np.array([0.0, 10.0, 30.0]), np.array([5.0, 0.5, -1.0])
    low, high = value_range([(steps, values)], (5.0, 40.0), is_log=False) or (0, 0)
    assert -1.3 < low < -1.0
    assert 0.5 < high < 0.8
    assert value_range([(steps, values)], (20.0, 40.0), is_log=True) is None, "nothing positive"
    assert value_range([], (0.0, 1.0), is_log=False) is None
