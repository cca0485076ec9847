"""A clip that waits for a computer of a cluster, or loses it. Ray is not needed for that."""

from __future__ import annotations

from typing import Any, cast

import pytest
from msgspec.structs import replace

from app.cluster import cluster_worker
from app.cluster.cluster_worker import MAX_RETRIES, WAITING, ClusterWorker
from app.cluster.nodes import Node, Seat
from app.training.jobs import train_job
from app.training.messages import Event, StageReported, Stop, TrainingStopped, WarningRaised, WorkerDied
from engine.children.kind import ChildFailed
from engine.clip_files.clip_state import ClipState, read_clip_state, write_clip_state
from tests.app.fakes import write_trained


class FullCluster:
    """No computer has room."""

    def take_notes(self) -> list[str]:
        """Nothing happened."""
        return []

    def seat_for(self, **_: Any) -> Seat | None:
        """There is none."""


class LossyCluster(FullCluster):
    """Has room on a computer that is lost whenever a clip trains there."""

    def __init__(self) -> None:
        self.node = Node("id", "far", 1, 1, sees_project=True)

    def seat_for(self, **_: Any) -> Seat:
        """The only one."""
        return Seat(self.node, 1, 1)


class LostChild:
    """Its computer was lost."""

    fault, pid, is_over, load = "lost", 1, True, None

    def __init__(self, *_: Any, **__: Any) -> None:
        """At once."""

    def poll(self) -> list[Event]:
        """Nothing was heard of it."""
        return []

    def result(self) -> None:
        """It gave none."""
        raise ChildFailed("The training process was lost", is_final=False)


@pytest.mark.parametrize("n_with_progress", [0, 10])
def test_a_clip_that_gets_further_before_each_loss_resumes_as_often_as_it_takes(
    make_opened, monkeypatch, n_with_progress: int
) -> None:
    opened = make_opened()
    job = train_job(opened.project, opened.clips[0], holdout=opened.holdout)
    kept = read_clip_state(write_trained(opened, 0))
    monkeypatch.setattr(cluster_worker, "FarChild", LostChild)
    worker = ClusterWorker(job, opened.project, cast(Any, LossyCluster()))
    said = list[Event]()
    for n in range(100):
        if said and isinstance(said[-1], WorkerDied):
            break
        if worker._attempt is None and n // 2 < n_with_progress:
            checkpoint = ClipState(kept.arrays, replace(kept.header, step=n + 1))
            write_clip_state(opened.project.checkpoint_path(0), checkpoint.stamped())
        said += worker.poll()
    assert isinstance(said[-1], WorkerDied), "without progress it ends"
    assert sum(isinstance(event, WarningRaised) for event in said) == max(n_with_progress - 1, 0) + MAX_RETRIES


def test_a_clip_without_a_computer_says_so_once_and_can_be_stopped(make_opened) -> None:
    opened = make_opened()
    job = train_job(opened.project, opened.clips[0], holdout=opened.holdout)
    worker = ClusterWorker(job, opened.project, cast(Any, FullCluster()))
    assert worker.poll() == [StageReported(WAITING, 0.0)]
    assert worker.poll() == [], "it is asked all the time, as long as it has something to say"
    worker.send(Stop(keep=True))
    assert worker.poll() == [TrainingStopped(is_kept=False, step=0)]
