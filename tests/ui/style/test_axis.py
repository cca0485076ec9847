"""Numbers along an axis of steps."""

from __future__ import annotations

import itertools

from hypothesis import given
from hypothesis import strategies as st

from ui.style.axis import ticks_that_fit, whole_ticks
from ui.style.numbers import format_count


@given(last=st.integers(1, 10**7), most=st.integers(2, 12))
def test_ticks_are_whole_round_few_and_inside(last: int, most: int) -> None:
    ticks = whole_ticks(float(last), most)
    assert ticks[0] == 0
    assert ticks[-1] <= last
    assert 1 <= len(ticks) <= most
    if len(ticks) > 1:
        step = ticks[1] - ticks[0]
        assert step > 0
        assert int(str(step).rstrip("0")) in (1, 2, 5)
        assert {b - a for a, b in itertools.pairwise(ticks)} == {step}


def test_the_last_number_stays_inside_the_plot() -> None:
    halves = {0: 4.0, 2000: 20.0, 4000: 20.0}
    assert ticks_that_fit(4000, 200.0, halves, [0, 2000, 4000]) == [0, 2000]
    assert ticks_that_fit(4320, 400.0, halves, [0, 2000, 4000]) == [0, 2000, 4000]


def test_one_format_for_counts() -> None:
    assert [format_count(n) for n in (0, 999, 4320, 1_234_567)] == ["0", "999", "4,320", "1,234,567"]
