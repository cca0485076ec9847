"""ProcessWorker: the window's side of one worker process: start it, talk to it, notice its death, end it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

from msgspec import Struct

from app.background.logs import tail
from app.project.project import Project
from app.training.messages import ENDINGS, Command, Event, TrainingFailed, TrainJob, WorkerDied
from engine.children.kind import ChildFailed, ChildKind
from engine.children.process import MAX_EVENTS_PER_POLL, Child, ChildProcess
from engine.errors import EngineError
from engine.portable import environment_of

BUILD = "app.training.worker.build:build_training"


class TrainTask(Struct, frozen=True):
    """The task of a worker process.

    Attributes:
        project: Folder of it, in which the worker's store lies.
        capture: Where its capture is.
        log: File for everything that the process prints.
        make: "module:name" of the function that builds the training, a MakeTraining.
    """

    job: TrainJob
    project: Path
    capture: Path
    log: Path
    make: str


TRAINING: ChildKind[TrainTask, Event, None] = ChildKind(
    place="app.training.process:TRAINING",
    work="app.training.worker.worker:main",
    what="The training process",
    job=TrainTask,
    event=Event,
    command=Command,
    grace_s=5.0,
)


class StartChild(Protocol):
    """Starts the process of a training: `ChildProcess`, or something that does so on another computer."""

    def __call__(
        self, kind: ChildKind[TrainTask, Event, None], job: TrainTask, *, environment: Mapping[str, str]
    ) -> Child[TrainTask, Event, None]:
        """environment: Variables in addition to those of the process."""
        ...


class Worker(Protocol):
    """One clip being trained, wherever that happens."""

    @property
    def job(self) -> TrainJob:
        """The job that it trains."""
        ...

    def send(self, command: Command) -> None:
        """Never blocks and never fails; a dead worker is noticed by `poll`."""
        ...

    def poll(self) -> list[Event]:
        """Events since the last call. The last one ever is an ending; a death is one."""
        ...

    def close(self, *, timeout_s: float) -> None:
        """End it for certain, keeping progress when there is time for it."""
        ...


class ProcessWorker:
    """A separate process. See `Worker`.

    Args:
        job: The training.
        project: Where it is read from and kept.
        make: See `TrainTask`.
        start: Starts the process, on this computer or on another one.

    Attributes:
        child: The process.
    """

    def __init__(self, job: TrainJob, project: Project, make: str = BUILD, *, start: StartChild = ChildProcess) -> None:
        self.job = job
        self._log_path = project.log_path(job.clip_index)
        self._has_ended = False
        task = TrainTask(job, project.folder, Path(project.settings.capture), self._log_path, make)
        self.child = start(TRAINING, task, environment=environment_of(job.cpu))

    def send(self, command: Command) -> None:
        """See `Worker`."""
        self.child.send(command)

    def poll(self) -> list[Event]:
        """See `Worker`."""
        if self._has_ended:
            return []
        is_over = self.child.is_over
        events = self.child.poll()
        self._has_ended = any(isinstance(event, ENDINGS) for event in events)
        if is_over and not self._has_ended and len(events) < MAX_EVENTS_PER_POLL:
            self._has_ended = True
            events.append(self._death())
        return events

    def close(self, *, timeout_s: float) -> None:
        """See `Worker`. Asks, waits, then kills."""
        self.child.end(timeout_s)
        self._has_ended = True

    def _death(self) -> TrainingFailed | WorkerDied:
        reason = f"{TRAINING.what} ended early"
        try:
            self.child.result()
        except EngineError as error:
            return TrainingFailed(type(error).__name__, *error.parts())
        except ChildFailed as error:
            reason = str(error)
        return WorkerDied(reason, tail(self._log_path))
