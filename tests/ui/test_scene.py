"""The viewport's choices that need no GL: how large a picture is while the view moves, which anchors are marked."""

from __future__ import annotations

import numpy as np
import pytest

from ui.anchor_marks import thinned
from ui.scene import MOVING_MS, MOVING_SHARES, moving_share


@pytest.mark.parametrize(
    ("drawn_share", "took_ms", "expected"),
    [
        (1.0, MOVING_MS, 1.0),
        (1.0, 4 * MOVING_MS, 0.5),  # time goes with the pixels, so half the width
        (0.5, MOVING_MS / 4, 1.0),
        (1.0, 1e4, MOVING_SHARES[0]),
        (1.0, 0.0, MOVING_SHARES[1]),
        (1.0, 1.3 * MOVING_MS, 0.875),  # in eighths, rounded down
    ],
)
def test_a_moving_picture_is_as_large_as_time_allows(drawn_share: float, took_ms: float, expected: float) -> None:
    assert moving_share(drawn_share, took_ms) == expected


def test_few_anchors_are_all_marked() -> None:
    positions = np.arange(30.0).reshape(10, 3)
    assert thinned(positions, 10) is positions


def test_many_anchors_are_thinned_evenly_and_always_alike() -> None:
    rows = np.arange(20_000)
    positions = np.stack([rows, rows % 10, rows * 0], axis=1).astype(np.float32)
    chosen = thinned(positions, 2_000)
    assert chosen.shape == (2_000, 3)
    assert len(np.unique(chosen[:, 0])) == 2_000
    np.testing.assert_array_equal(chosen, thinned(positions, 2_000))
    # Each tenth row would all lie in one of ten columns. By chance 200 fall in each, give or take 13 (one sigma).
    assert np.bincount(chosen[:, 1].astype(int)).min() > 140
