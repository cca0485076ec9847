"""A clip that waits for a computer of a cluster. Ray is not needed for that."""

from __future__ import annotations

from typing import Any, cast

from app.cluster.cluster_worker import WAITING, ClusterWorker
from app.training.jobs import train_job
from app.training.messages import StageReported, Stop, TrainingStopped


class FullCluster:
    """No computer has room."""

    def take_notes(self) -> list[str]:
        """Nothing happened."""
        return []

    def seat_for(self, **_: Any) -> None:
        """There is none."""


def test_a_clip_without_a_computer_says_so_once_and_can_be_stopped(make_opened) -> None:
    opened = make_opened()
    job = train_job(opened.project, opened.clips[0], holdout=opened.holdout)
    worker = ClusterWorker(job, opened.project, cast(Any, FullCluster()))
    assert worker.poll() == [StageReported(WAITING, 0.0)]
    assert worker.poll() == [], "it is asked all the time, as long as it has something to say"
    worker.send(Stop(keep=True))
    assert worker.poll() == [TrainingStopped(is_kept=False, step=0)]
