"""Numbers on the axes of plots: round, in the plot, and as many as there is room for."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from ui.style.axis import log_ticks, round_ticks, tick_text


@given(low=st.floats(-1e4, 1e4), span=st.floats(1e-3, 1e5), most=st.integers(1, 12))
def test_values_are_round_and_inside(low: float, span: float, most: int) -> None:
    ticks = round_ticks(low, low + span, most)
    assert len(ticks) <= most
    assert all(low - 1e-6 * span <= tick <= low + span * (1 + 1e-6) for tick in ticks)
    if len(ticks) > 1:
        step = ticks[1] - ticks[0]
        leading = step / 10 ** math.floor(math.log10(step * (1 + 1e-6)))
        assert min(abs(leading - factor) for factor in (1, 2, 5, 10)) < 1e-3


def test_as_many_as_fit() -> None:
    assert round_ticks(0.0, 4320.0, 5, least=1.0) == [0, 1000, 2000, 3000, 4000]
    assert round_ticks(194.5, 2031.2, 4, least=1.0) == [500, 1000, 1500, 2000]
    assert round_ticks(0.0, 3.2, 9, least=1.0) == [0, 1, 2, 3]
    assert round_ticks(5.0, 5.0, 4) == [5.0]


@given(low=st.floats(1e-6, 1e3), factor=st.floats(1.05, 1e6), most=st.integers(2, 8))
def test_logarithmic_values_are_inside(low: float, factor: float, most: int) -> None:
    ticks = log_ticks(low, low * factor, most)
    assert 1 <= len(ticks) <= most
    assert all(low * (1 - 1e-9) <= tick <= low * factor * (1 + 1e-9) for tick in ticks)


def test_logarithmic_values_are_powers_of_ten_first() -> None:
    assert log_ticks(0.001, 1.0, 4) == [0.001, 0.01, 0.1, 1.0]
    assert log_ticks(0.009, 0.05, 3) == [0.01, 0.02, 0.05]


def test_words_have_the_decimals_that_tell_neighbours_apart() -> None:
    assert [tick_text(value, 0.5) for value in (26.0, 26.5)] == ["26.0", "26.5"]
    assert tick_text(1000.0, 500.0) == "1,000"
    assert tick_text(0.002, 0.001) == "0.002"
    assert tick_text(0.0, 0.001) == "0"
    assert tick_text(2e-6, 1e-6) == "2e-06"
