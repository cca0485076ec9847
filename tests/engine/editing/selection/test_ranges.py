"""Ranges of an attribute, its histogram, and what modes do to a selection."""

from __future__ import annotations

import numpy as np
import pytest

from engine.editing.selection.ranges import in_range, spread_of
from engine.editing.selection.set_algebra import SELECT_MODES, combined


def test_a_range_holds_both_ends_and_nothing_unknown() -> None:
    values = np.array([0.0, 0.2, 0.5, np.nan, 0.8, np.inf])
    assert in_range(values, 0.2, 0.8).tolist() == [False, True, True, False, True, False]
    assert not in_range(values, 0.8, 0.2).any()
    assert not in_range(values, np.nan, 1.0).any()


@pytest.mark.parametrize("is_log", [False, True])
def test_a_histogram_counts_every_known_value_once(is_log: bool) -> None:
    values = np.exp(np.random.default_rng(0).normal(size=500))
    values[:7], values[7] = np.nan, 0.0
    spread = spread_of(values, n_bins=20, is_log=is_log)
    assert spread is not None
    known = values[np.isfinite(values) & ((values > 0.0) | (not is_log))]
    places = np.log(known) if is_log else known
    truth, _ = np.histogram(places, bins=20)
    assert np.abs(spread.counts - truth).sum() <= 2  # a value may lie on the border of two bins
    assert spread.counts.sum() == len(known)
    assert spread.n_unknown == 500 - len(known)
    for share in (0.0, 0.3, 1.0):
        assert spread.share_at(spread.value_at(share)) == pytest.approx(share)
    assert spread.share_at(-5.0) == 0.0
    assert spread.share_at(1e9) == 1.0


def test_a_histogram_of_one_value_or_of_none() -> None:
    spread = spread_of(np.full(9, 0.25))
    assert spread is not None
    assert spread.counts[0] == 9
    assert (spread.low, spread.high) == (0.25, 0.25)
    assert spread.share_at(0.25) == 0.0
    assert spread.value_at(0.7) == 0.25
    assert spread_of(np.full(4, np.nan)) is None
    assert spread_of(np.zeros(0)) is None
    assert spread_of(np.zeros(4), is_log=True) is None


def test_modes_are_the_algebra_of_sets() -> None:
    before, found = np.array([1, 1, 0, 0], bool), np.array([1, 0, 1, 0], bool)
    sets = {"replace": [0, 2], "add": [0, 1, 2], "subtract": [1], "intersect": [0]}
    assert set(sets) == set(SELECT_MODES)
    for mode in SELECT_MODES:
        assert np.flatnonzero(combined(before, found, mode)).tolist() == sets[mode]
    with pytest.raises(ValueError, match="modes are"):
        combined(before, found, "xor")  # pyright: ignore[reportArgumentType]
