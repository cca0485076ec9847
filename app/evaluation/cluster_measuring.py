"""Measuring on the computers of a Ray cluster: processes as on this one, each with cameras of its own.

Only computers that see project and capture take part: they read them, and send figures. Where one is lost, the others
measure what it has not sent.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from msgspec.structs import replace

from app.cluster.cluster import Cluster
from app.cluster.connecting import check_address
from app.cluster.errands import SharedProject
from app.cluster.far_child import FarChild
from app.cluster.nodes import MEASURING, Node, Seat
from app.cluster.ray_library import check_ray
from app.evaluation.evaluation import EvaluationScope, Frames, Measuring
from app.evaluation.headless import TrainedProject
from app.evaluation.measuring_children import (
    POLL_S,
    EvaluationTask,
    FigureEvent,
    MeasuringChildren,
    MeasuringLost,
    measuring_here,
)
from engine.capture.capture import Capture
from engine.children.kind import ChildKind
from engine.metrics.clips.seams import PairRow
from engine.metrics.clips.summary import EvalRow
from engine.training.plan.forecast import rough_memory_mb

FarMeasuring = FarChild[EvaluationTask, FigureEvent, None]
MAX_LOST = 3
"""Times that processes may be lost in one clip: whatever ends them more often will do so again."""
_N_HELD = 100
"""Pictures of one camera in memory while its background is found: fifty, twice."""


@contextmanager
def measuring_at(n_workers: int, cluster: str | None, say: Callable[[str], None]) -> Iterator[Measuring | None]:
    """What measures with so many processes here, or on a cluster; None where this process will do.

    Args:
        cluster: Address; None without one.
        say: Receives sentences for the user.
    Raises:
        ProjectError: It is not an address, or Ray is not installed.
    """
    if cluster is None:
        with measuring_here(n_workers) as measuring:
            yield measuring
        return
    with ClusterMeasuring(cluster, say) as measuring:
        yield measuring


class ClusterMeasuring:
    """A `Measuring` of a cluster, which is joined once figures of a project are missing, and left with the block.

    Args:
        address: See `Cluster`.
        say: Receives sentences for the user.
    Raises:
        ProjectError: It is not an address, or Ray is not installed.
    """

    def __init__(self, address: str, say: Callable[[str], None]) -> None:
        check_ray()
        check_address(address)
        self._address, self._say = address, say
        self._cluster: Cluster | None = None
        self._children: MeasuringChildren | None = None
        self._seats: list[Seat] = []
        self._started: list[tuple[Node, FarMeasuring]] = []
        self._avoided: list[Node] = []

    def __enter__(self) -> ClusterMeasuring:
        return self

    def __exit__(self, *_: object) -> None:
        self._leave()

    def __call__(
        self, opened: TrainedProject, scope: EvaluationScope, clip_index: int, unknown: Frames
    ) -> Iterator[EvalRow | PairRow]:
        """Missing rows and pairs, cameras mixed.

        Raises:
            ProjectError: No computer of the cluster can measure.
            EngineError: A process failed, or processes were lost again and again.
        """
        cluster, cameras = self._joined(opened), opened.capture.rig.names
        left = {camera: (list(frames), list(pairs)) for camera, (frames, pairs) in unknown.items()}
        for n_lost in range(MAX_LOST + 1):
            try:
                for item in self._processes(cluster, len(scope.cameras))(opened, scope, clip_index, left):
                    frames, pairs = left[cameras.index(item.camera)]
                    (frames if isinstance(item, EvalRow) else pairs).remove(item.frame_index)
                    yield item
                    self._pass_on(cluster)
            except MeasuringLost as error:
                self._end_processes()
                if n_lost == MAX_LOST:
                    raise
                self._say(f"Note: {error.message} What it has not sent is measured elsewhere.")
                left = {camera: missing for camera, missing in left.items() if any(missing)}
            else:
                return

    def _joined(self, opened: TrainedProject) -> Cluster:
        """The cluster, joined for this project."""
        if self._cluster is None or self._cluster.project is not opened.project:
            self._leave()
            n_bytes = memory_of(opened.capture)
            self._cluster = Cluster(self._address, opened.project, opened.capture, n_bytes=n_bytes, use=MEASURING)
            for sentence in self._cluster.words:
                self._say(f"Note: {sentence}")
            self._pass_on(self._cluster)
        return self._cluster

    def _pass_on(self, cluster: Cluster) -> None:
        for note in cluster.take_notes():
            self._say(f"Note: {note}")

    def _processes(self, cluster: Cluster, n_cameras: int) -> MeasuringChildren:
        """Processes for so many cameras, one in every place that is free."""
        if self._children is None:
            self._take_seats(cluster, n_cameras)
            seats = itertools.cycle(self._seats)

            def start(kind: ChildKind[EvaluationTask, FigureEvent, None], task: EvaluationTask) -> FarMeasuring:
                seat = next(seats)
                there = SharedProject(replace(task, n_threads=seat.n_threads))
                self._started.append((seat.node, FarChild(kind, seat=seat, errand=there, environment={})))
                return self._started[-1][1]

            self._children = MeasuringChildren(len(self._seats), start=start)
        return self._children

    def _take_seats(self, cluster: Cluster, n: int) -> None:
        """So many places, or as many as there are: at least one."""
        while len(self._seats) < n:
            seat = cluster.seat_for(n_beside=cluster.n_slots, avoided=self._avoided)
            if seat is not None:
                self._seats.append(seat)
            elif self._seats:
                return
            else:  # a computer has just joined, and is asked
                time.sleep(POLL_S)

    def _end_processes(self) -> None:
        if self._children is not None:
            self._children.end()
        for seat in self._seats:
            seat.leave()
        self._avoided += [node for node, child in self._started if child.fault == "lost"]
        self._children, self._seats, self._started = None, [], []

    def _leave(self) -> None:
        self._end_processes()
        if self._cluster is not None:
            self._cluster.close()
        self._cluster, self._avoided = None, []


def memory_of(capture: Capture) -> int:
    """Most that a process that measures holds, in bytes."""
    width, height = (int(size) for size in capture.rig.image_sizes.max(0))
    n_pictures = len(capture.rig) * capture.n_frames
    return int(1e6 * rough_memory_mb((1, _N_HELD, height, width), n_read=n_pictures))
