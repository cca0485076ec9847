"""Matches of pairs without a calibration, in a child process."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from engine.children.kind import ChildFailed
from engine.features.child import arrays_kind, work_on_arrays
from engine.features.matching import match_pairs
from tests.engine.cloud.stereo.test_sparse import wall_views


@pytest.mark.slow
def test_places_of_a_wall_are_matched_where_they_are() -> None:
    pictures, _ = wall_views(3)
    found = match_pairs(pictures, [(0, 1), (0, 2)])
    assert "pycolmap" not in sys.modules
    assert [(pair.first, pair.second) for pair in found.pairs] == [(0, 1), (0, 2)]
    for pair, step_px in zip(found.pairs, (20, 40), strict=True):
        assert len(pair) > 50
        moved = pair.pixels - pair.other_pixels
        assert np.abs(np.median(moved, axis=0) - [step_px, 0]).max() < 0.3
    assert (found.n_features > 100).all()


def test_what_a_child_cannot_do_is_a_reason_not_a_traceback() -> None:
    broken = arrays_kind("engine.features.no_such_module:KIND", "engine.features.none:main", "the broken process")
    with pytest.raises(ChildFailed, match=r"the broken process ended with code 1 .*no_such_module"):
        work_on_arrays(broken, {"x": np.zeros(1)})


def test_cancelling_ends_the_child() -> None:
    def stop() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        match_pairs(wall_views(2)[0], [(0, 1)], alive=stop)
