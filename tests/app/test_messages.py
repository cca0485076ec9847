"""Every message of a training reaches the other side as what it was."""

from __future__ import annotations

import math
from pathlib import Path

import msgspec
import pytest

from app.training.messages import Command, Event, SetSnapshots, StepReported, TrainJob, WorkerDied
from app.training.process import TrainTask
from engine.capture.clip import Clip
from engine.capture.exclusions import ExcludedFrames, Exclusions
from engine.children.messages import decoded, encoded
from engine.gate.regions import GateRegion


def test_a_job_arrives_as_it_was_sent() -> None:
    overrides = {"field": "continue", "joint_steps": 3, "rate": 1.0, "light": True}
    job = TrainJob(
        "0002",
        Clip(2, 6, 3, 3),
        "f",
        reference="0000",
        holdout=(1, 5),
        overrides=overrides,
        frames=(0, 7),
        exclusions=Exclusions(("a",), (ExcludedFrames(None, 0, 2),)),
        regions=(GateRegion("static", (0.0, 1.0, 2.0), (3.0, 4.0, 5.0)),),
    )
    task = decoded(encoded(TrainTask(job, Path("p"), Path("capture"), Path("logs/a.log"), "module:name")), TrainTask)
    assert task == TrainTask(job, Path("p"), Path("capture"), Path("logs/a.log"), "module:name")
    assert [type(value) for value in task.job.overrides.values()] == [str, int, float, bool]


def test_messages_are_known_by_their_names() -> None:
    assert decoded(encoded(SetSnapshots("low")), Command) == SetSnapshots("low")
    assert decoded(encoded(WorkerDied("It ended")), Event) == WorkerDied("It ended")
    with pytest.raises(msgspec.DecodeError):
        decoded(encoded(SetSnapshots("low")), Event)


def test_numbers_that_are_not_finite_arrive_too() -> None:
    back = decoded(encoded(StepReported(1, 2, math.nan, math.inf, 3, "joint", 0.0, 1.0)), Event)
    assert math.isnan(back.loss)
    assert back.train_psnr == math.inf
