"""Steps are timed in a process of their own; what was not timed to the end is not kept."""

from __future__ import annotations

import pytest

from app.plan import speed
from engine.children.kind import ChildFailed, Unwanted
from engine.children.process import run_child
from engine.training.config import TrainConfig
from engine.training.plan.plan import StepSizes

SIZES = StepSizes(32, 24, 100, 10, TrainConfig())


@pytest.mark.slow
def test_steps_are_timed(monkeypatch):
    monkeypatch.setattr(speed, "run_child", run_child)  # which tests otherwise do without
    found_s = speed.step_time(SIZES, "joint")
    assert found_s is not None
    assert 0.0 < found_s < speed.TIMEOUT_S
    assert speed.known_step_time(SIZES, "joint") == found_s


def test_an_interrupted_timing_is_not_kept(monkeypatch):
    monkeypatch.setattr(speed, "run_child", run_child)
    with pytest.raises(Unwanted):
        speed.step_time(SIZES, "joint", lambda: False)
    assert speed._known == {}


def test_a_failed_timing_is_not_tried_again(monkeypatch):
    def fail(*_, **__) -> float:
        raise ChildFailed("it was ended by signal 9", is_final=False)

    monkeypatch.setattr(speed, "run_child", fail)
    assert speed.step_time(SIZES, "joint") is None
    assert (SIZES, "joint") in speed._known
