"""ClusterWorker: one clip being trained on some computer of a cluster. See `Worker`. Where one is lost, another one
continues from the last checkpoint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from msgspec.structs import replace

from app.cluster.cluster import Cluster
from app.cluster.errands import CopiedProject, SharedProject
from app.cluster.far_child import Errand, FarChild
from app.cluster.nodes import Node, Seat
from app.project.claims.holder_record import MachineLoad
from app.project.project import Project
from app.training.messages import (
    ENDINGS,
    Command,
    Event,
    LoadReported,
    StageReported,
    Stop,
    TrainingFailed,
    TrainingStopped,
    TrainJob,
    WarningRaised,
    WorkerDied,
)
from app.training.process import BUILD, ProcessWorker, TrainTask
from engine.children.kind import ChildKind
from engine.clip_files.clip_state import read_clip_header
from engine.errors import EngineError

MAX_RETRIES = 3
"""In a row, without a newer checkpoint in the project: a computer may be lost as often as a clip gets further."""
WAITING = "Waiting for a computer"
SENDING = "Copying the capture"
_OF_THE_CAPTURE = ("CaptureError", "OutsideError", "ProjectGone")


@dataclass(frozen=True, slots=True)
class NodeAttempt:
    """A clip on one computer: its place, and its process there."""

    seat: Seat
    worker: ProcessWorker
    child: FarChild[TrainTask, Event, None]


class ClusterWorker:
    """See the module docstring.

    Args:
        job: The training.
        project: That of the cluster.
        cluster: Where it runs.
        make: See `TrainTask`.
    """

    def __init__(self, job: TrainJob, project: Project, cluster: Cluster, make: str = BUILD) -> None:
        self.job = job if job.is_window_open else replace(job, live_view="off")  # nobody looks, and it would be sent
        self._project, self._cluster, self._make = project, cluster, make
        self._attempt: NodeAttempt | None = None
        self._commands: list[Command] = []
        self._avoided: list[Node] = []
        self._said: list[Event] = []
        self._is_whole = self._is_waiting = False
        self._n_retries, self._reached = 0, -1
        self._load: MachineLoad | None = None
        self._has_ended = False

    def send(self, command: Command) -> None:
        """See `Worker`. The last of each kind is said again to another computer that continues."""
        self._commands = [known for known in self._commands if type(known) is not type(command)] + [command]
        if self._attempt is not None:
            self._attempt.worker.send(command)

    def poll(self) -> list[Event]:
        """See `Worker`."""
        if self._has_ended:
            return []
        said, self._said = self._said, []
        said += [WarningRaised(note) for note in self._cluster.take_notes()]
        try:
            said += self._begin() if self._attempt is None else self._events(self._attempt)
        except EngineError as error:
            said.append(TrainingFailed(type(error).__name__, *error.parts()))
        self._has_ended = any(isinstance(event, ENDINGS) for event in said)
        if self._has_ended:
            self._leave()
        return said

    def close(self, *, timeout_s: float) -> None:
        """See `Worker`."""
        self._has_ended = True
        if self._attempt is not None:
            self._attempt.worker.close(timeout_s=timeout_s)
        self._leave()

    # ---------------------------------------------------------------- one computer after the other

    def _begin(self) -> list[Event]:
        if self._stop is not None:
            return [self._stopped(self._stop)]
        seat = self._cluster.seat_for(n_beside=self.job.n_beside, avoided=self._avoided)
        if seat is None:
            is_told, self._is_waiting = self._is_waiting, True
            return [] if is_told else [StageReported(WAITING, 0.0)]
        self._is_waiting = False
        started: list[FarChild[TrainTask, Event, None]] = []

        def start(
            kind: ChildKind[TrainTask, Event, None], job: TrainTask, *, environment: Mapping[str, str]
        ) -> FarChild[TrainTask, Event, None]:
            started.append(FarChild(kind, seat=seat, errand=self._errand(seat, job), environment=environment))
            return started[0]

        worker = ProcessWorker(replace(self.job, n_threads=seat.n_threads), self._project, self._make, start=start)
        self._attempt = NodeAttempt(seat, worker, started[0])
        for command in self._commands:
            worker.send(command)
        return [StageReported(f"Starting on {seat.node.name}", 0.0)]

    def _errand(self, seat: Seat, task: TrainTask) -> Errand[TrainTask]:
        if seat.node.sees_project:
            return SharedProject(replace(task, project=task.project.absolute(), log=task.log.absolute()))

        def report(done: float) -> None:
            self._said = [StageReported(f"{SENDING} to {seat.node.name}", done)]

        return CopiedProject(self._cluster, seat.node, task, is_whole=self._is_whole, report=report)

    def _events(self, attempt: NodeAttempt) -> list[Event]:
        if self._stop is not None and attempt.child.pid is None:
            attempt.worker.close(timeout_s=0.0)
            return [self._stopped(self._stop)]
        events = self._load_of(attempt) + attempt.worker.poll()
        if not events or not isinstance(ending := events[-1], TrainingFailed | WorkerDied):
            return events
        why = self._why_again(ending, attempt)
        if why is None or not self._may_retry():
            return events
        self._leave()
        title = f"Clip {self.job.clip_index} resumes, on another computer if there is one"
        return [*events[:-1], WarningRaised(title, f"{why.rstrip('.')}.")]

    def _load_of(self, attempt: NodeAttempt) -> list[Event]:
        if attempt.child.load is self._load or attempt.child.load is None:
            return []
        self._load = attempt.child.load
        return [LoadReported(self._load)]

    def _may_retry(self) -> bool:
        """Whether another attempt is due: the last ones have got further, or there were few."""
        header = read_clip_header(self._project.checkpoint_path(self.job.clip_index))
        step = -1 if header is None else header.step
        self._n_retries = 1 if step > self._reached else self._n_retries + 1
        self._reached = max(step, self._reached)
        return self._n_retries <= MAX_RETRIES

    def _why_again(self, ending: TrainingFailed | WorkerDied, attempt: NodeAttempt) -> str | None:
        """Why another attempt may succeed, elsewhere if possible; None where it would be the same."""
        node, fault = attempt.seat.node, attempt.child.fault
        is_copied = not node.sees_project
        if isinstance(ending, WorkerDied):
            self._avoided.append(node)
            return ending.reason if fault == "lost" else None
        why = f"{node.name}: {ending.message}"
        if ending.kind in _OF_THE_CAPTURE and is_copied and not self._is_whole:
            self._is_whole = True
            return why
        if ending.kind in _OF_THE_CAPTURE and not is_copied:
            self._cluster.ask(node)  # its share may be gone: then it works on a copy from now on
            self._avoided.append(node)
            return why
        if ending.kind == "DiskError" and is_copied and fault != "here":
            self._cluster.refuse(node, f"has no room: {ending.message.rstrip('.')}")
            return why
        return None

    @property
    def _stop(self) -> Stop | None:
        return next((command for command in self._commands if isinstance(command, Stop)), None)

    def _stopped(self, stop: Stop) -> TrainingStopped:
        """Before it had begun. Progress is in the project."""
        if not stop.keep:
            self._project.discard_progress(self.job.clip_index)
        is_kept = self._project.checkpoint_path(self.job.clip_index).is_file()
        return TrainingStopped(is_kept, 0)

    def _leave(self) -> None:
        if self._attempt is not None:
            self._attempt.seat.leave()
            self._attempt = None
