"""The viewport's choices that need no GL: which anchors are marked."""

from __future__ import annotations

import numpy as np

from ui.viewport.layers.anchor_marks import thinned


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
