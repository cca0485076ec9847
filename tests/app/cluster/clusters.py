"""Ray clusters of several nodes on this computer, and trainings that take a moment, for tests of app.cluster."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from app.cluster.cluster import Cluster
from app.cluster.cluster_worker import ClusterWorker
from app.cluster.nodes import Node
from app.project.opening.opened_project import OpenedProject
from app.training.messages import ClipTrained, Event, TrainJob
from app.training.service import TrainingService
from app.training.store import ClipStore
from engine.progress import Progress, StepStats
from tests.app.fakes import FakeTraining, make_fake

DEADLINE_S = 600.0
N_BYTES = 50 << 20
MAKE = "tests.app.cluster.clusters:make_brief"
STEP_S = 0.15
HOLDS_AT = "CLIPGSTREAM_TEST_HOLDS_AT"
"""A variable of a node: source clips stand still there from this step on, so that they are unfinished at any time."""


@dataclass
class BriefTraining(FakeTraining):
    """Takes a moment for every step, as a real one does."""

    def step(self, n: int = 1) -> StepStats:
        time.sleep(STEP_S)
        before = self.steps_done, self.value
        stats = super().step(1)
        if self.reference is not None and self.steps_done > float(os.environ.get(HOLDS_AT, "inf")):
            self.steps_done, self.value = before
        return stats


def make_brief(job: TrainJob, store: ClipStore, report: Callable[[Progress], None]) -> BriefTraining:
    """Reads the pictures of its clip, as a real one does. `joint_steps` sets the number of steps."""
    fake = make_fake(job, store, report)
    for camera in range(len(fake.capture.rig)):
        fake.capture.frames_of(camera, list(job.clip.frame_indices()))
    return BriefTraining(fake.capture, fake.clip, fake.reference, report, n_steps=fake.n_steps)


class BlindCluster(Cluster):
    """Its nodes take the project for another one, as where they do not share its folder."""

    def ask(self, node: Node) -> None:
        self._nonce = "0" * 32
        super().ask(node)


@dataclass
class Driver:
    """A service on a cluster, and what it has reported."""

    opened: OpenedProject
    cluster: Cluster
    service: TrainingService
    events: list[tuple[int, Event]] = field(default_factory=list)

    def poll_until(self, is_done: Callable[[], bool]) -> None:
        until_s = time.monotonic() + DEADLINE_S
        while not is_done():
            assert time.monotonic() < until_s, self.events[-20:]
            assert not self.service.queue.failed, self.events[-5:]
            self.events += self.service.poll()
            time.sleep(0.02)

    def run_out(self) -> None:
        self.poll_until(lambda: not self.service.is_busy and not self.service.queue)

    @property
    def trained(self) -> list[int]:
        return [clip for clip, event in self.events if isinstance(event, ClipTrained)]

    def on_node(self, node_id: str) -> list[int]:
        """Clips that train on a node."""
        found = ((clip, run.worker) for clip, run in self.service.runs.items())
        attempts = ((clip, worker._attempt) for clip, worker in found if isinstance(worker, ClusterWorker))
        return [clip for clip, attempt in attempts if attempt is not None and attempt.seat.node.node_id == node_id]


@contextmanager
def driving(
    opened: OpenedProject, address: str, *, make: str = MAKE, kind: type[Cluster] = Cluster
) -> Iterator[Driver]:
    """Drive trainings of a project on the cluster at an address."""
    cluster = kind(address, opened.project, opened.capture, n_bytes=N_BYTES)

    def launch(job: TrainJob, project: Any) -> ClusterWorker:
        return ClusterWorker(job, project, cluster, make)

    service = TrainingService(
        opened.project,
        opened.clips,
        holdout=opened.holdout,
        launch=launch,
        is_window_open=False,
        n_workers=cluster.n_slots,
    )
    try:
        yield Driver(opened, cluster, service)
    finally:
        service.close(timeout_s=20.0)
        cluster.close()


@contextmanager
def ray_nodes(n: int, caches: Path, **environment: str) -> Iterator[Any]:
    """A Ray cluster: a head that trains nothing, and nodes of one core. Each has a folder for caches of its own."""
    from ray.cluster_utils import Cluster as RayCluster

    made = RayCluster(initialize_head=True, head_node_args={"num_cpus": 0, "object_store_memory": 80 << 20})
    try:
        for k in range(n):
            add_node(made, caches / str(k), **environment)
        yield made
    finally:
        made.shutdown()


def add_node(made: Any, cache: Path, **environment: str) -> Any:
    """Add a node of one core. cache: Its folder for caches."""
    variables = {"XDG_CACHE_HOME": str(cache), **environment}
    node = made.add_node(num_cpus=1, env_vars=variables, object_store_memory=80 << 20)
    made.wait_for_nodes()
    return node
