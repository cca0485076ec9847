"""Snapshots come at a bounded rate, one unconsumed at a time, and none is left."""

import numpy as np
import pytest

from app.training.snapshots import Cadence, SnapshotWriter, is_finite
from engine.clip_files.clip_state import ClipState, read_clip_state
from tests.app.made_projects import clip_header
from tests.clip_headers import make_header


def state(step: int) -> ClipState:
    return ClipState({"values": np.full(3, step, np.float32)}, clip_header(0, step=step))


def test_the_first_is_due_one_interval_after_the_first_question():
    cadence = Cadence(2.0)
    assert [cadence.is_due(now_s) for now_s in (10.0, 11.9, 12.0)] == [False, False, True]


def test_a_slow_one_is_done_less_often():
    cadence = Cadence(2.0, max_share=0.1)
    cadence.is_due(0.0)
    cadence.done(10.0, 10.1)
    assert not cadence.is_due(11.9)
    assert cadence.is_due(12.0)
    cadence.done(20.0, 21.0)  # a second at a tenth of the time
    assert not cadence.is_due(29.9)
    assert cadence.is_due(30.0)


def test_there_is_one_unconsumed_snapshot_at_a_time_and_older_ones_go(tmp_path):
    writer = SnapshotWriter(tmp_path, 4)
    assert writer.is_free
    first = writer.write(state(1))
    assert not writer.is_free
    writer.consumed(first.revision)
    assert writer.is_free
    second = writer.write(state(2))
    assert (first.revision, second.revision, second.step) == (1, 2, 2)
    assert len(list(tmp_path.iterdir())) == 2  # its reader may still look at the first
    writer.consumed(second.revision)
    (left,) = tmp_path.iterdir()
    assert read_clip_state(left).header.step == 2
    writer.consumed(first.revision)  # late news changes nothing
    assert writer.is_free
    writer.clear()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("value", "expected"), [(1.0, True), (np.nan, False), (np.inf, False)])
def test_a_state_with_nan_or_infinity_is_not_finite(value, expected):
    arrays = {"a": np.array([1.0, value], np.float32), "b": np.array([True]), "c": np.array([1], np.int64)}
    assert is_finite(ClipState(arrays, make_header())) is expected
