"""ClipRun: one clip in training as its project's owner sees it: the worker, its last reports, and the way of the
finished clip into the project."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from app.background.latest import nothing
from app.project.claims.claims import lost_claim
from app.project.claims.holder_record import ClipProgress, MachineLoad
from app.project.clips.clip_catalog import ClipRecord
from app.project.clips.finished_clip import take_in
from app.project.project import Project
from app.training.arrival import Arrival
from app.training.curves import Curves, append_thinned, read_curves
from app.training.messages import (
    ENDINGS,
    ClipTrained,
    Command,
    Event,
    HeldOutMeasured,
    LoadReported,
    Pause,
    Resume,
    SetSnapshots,
    SnapshotWritten,
    StageReported,
    StepReported,
    Stop,
    TrainingFailed,
    TrainingPaused,
    TrainingResumed,
    TrainingStopped,
    TrainJob,
    WarningRaised,
    WorkerDied,
    WorkerReady,
)
from app.training.process import Worker
from engine.errors import ProjectError

STAGE_WORDS = {
    "static": "Learning the static scene",
    "joint": "Learning motion",
    "moving": "Learning motion alone",
    "source": "Learning new content",
}


@dataclass(frozen=True, slots=True)
class ShownState:
    """A state of a clip as a file.

    Attributes:
        revision: Names the state.
        is_live: Whether it is a snapshot, which its worker replaces and removes as it continues.
        reference_file: The clip it is shown with, where that is not the project's reference as it is now.
    """

    file: Path
    revision: str
    is_live: bool = False
    reference_file: Path | None = None


@dataclass(frozen=True, slots=True)
class HandedOver:
    """In place of a worker, which is not needed: the clip was trained before and has only to be taken in, or cannot be
    trained."""

    job: TrainJob
    ending: ClipTrained | TrainingFailed

    def send(self, command: Command) -> None:
        """See `Worker`."""

    def poll(self) -> list[Event]:
        """See `Worker`."""
        return [self.ending]

    def close(self, *, timeout_s: float) -> None:
        """See `Worker`."""


@dataclass
class ClipRun:
    """One training from its start to its end, also after that.

    Attributes:
        number: In the names of live states: each worker counts its own from one.
        step, n_steps, held_out_psnr, curves: Its progress.
        stage, last_step: The worker's last reports.
        check: Raises ProjectError where a clip may no longer be put in its place by this process.
        pid, machine: Process of the worker, and its computer; None and empty before it has reported them.
        load: Of that computer, where it is another one.
        worker_number: Which of the workers side by side it has, from 1.
        live_view: How often its worker writes snapshots now, one of LIVE_VIEWS.
        began_s: When it was started, by time.monotonic.
        ending: How it ended; None while it continues.
    """

    worker: Worker
    project: Project
    number: int
    check: Callable[[], None] = nothing
    step: int = 0
    n_steps: int = 0
    held_out_psnr: float | None = None
    curves: Curves = field(default_factory=Curves)
    stage: StageReported = field(default_factory=lambda: StageReported("", 0.0))
    last_step: StepReported | None = None
    pid: int | None = None
    machine: str = ""
    load: MachineLoad | None = None
    worker_number: int = 1
    live_view: str = "live"
    began_s: float = field(default_factory=time.monotonic)
    is_paused: bool = False
    is_stopping: bool = False
    ending: Event | None = None
    shown: ShownState | None = None
    _trained: ClipTrained | None = None
    _arrival: Arrival | None = None

    @property
    def clip_index(self) -> int:
        """The clip in training."""
        return self.worker.job.clip_index

    @property
    def has_failed(self) -> bool:
        """Whether it ended with an error."""
        return isinstance(self.ending, TrainingFailed | WorkerDied)

    @property
    def state(self) -> str:
        """See TrainingStatus.state."""
        if self.ending is not None:
            return "failed" if self.has_failed else "idle"
        if self.is_stopping:
            return "stopping"
        if self.is_paused:
            return "paused"
        if self.pid is None and self.last_step is None:
            return "starting"
        return "preparing" if self.last_step is None else "running"

    @property
    def eta_s(self) -> float | None:
        """Seconds until it is finished; None when unknown."""
        step = self.last_step
        if step is None or step.steps_per_s <= 0 or self.state != "running":
            return None
        return (step.n_steps - step.step) / step.steps_per_s

    @property
    def progress(self) -> ClipProgress:
        """How far it is, for others."""
        is_running = self.last_step is not None and self.state == "running"
        return ClipProgress(
            self.clip_index,
            self.state,
            self.machine,
            self.stage.stage,
            self.step,
            self.n_steps,
            self.last_step.steps_per_s if is_running and self.last_step is not None else 0.0,
            self.eta_s,
            self.held_out_psnr,
            time.monotonic() - self.began_s,
            self.load,
        )

    @property
    def message(self) -> str:
        """One line with counts and reasons; why it failed, once it has."""
        if self.has_failed:
            return self.ending.message if isinstance(self.ending, TrainingFailed) else "The worker ended unexpectedly."
        return self.stage.message if self.ending is None else ""

    def take_up(self, record: ClipRecord) -> None:
        """Begin with the progress of an earlier run. record: Of the clip."""
        if record.resume_step is None:
            return
        self.step, self.n_steps = record.resume_step, record.resume_n_steps
        self.curves = read_curves(self.project.curve_path(self.clip_index, is_finished=False))
        self.held_out_psnr = self.curves.psnr[-1][1] if self.curves.psnr else None

    # ---------------------------------------------------------------- commands

    def pause(self) -> None:
        """Hold after the current step."""
        if not self.is_stopping:
            self.is_paused = True
            self.worker.send(Pause())

    def resume(self) -> None:
        """Resume after a pause."""
        if self.is_paused:
            self.is_paused = False
            self.worker.send(Resume())

    def show(self, live_view: str) -> None:
        """Write snapshots this often from now on."""
        if live_view != self.live_view:
            self.live_view = live_view
            self.worker.send(SetSnapshots(live_view))

    def stop(self, *, keep: bool = True) -> None:
        """End it after the current step."""
        self.is_stopping = True
        self.worker.send(Stop(keep=keep))

    def close(self, *, timeout_s: float) -> None:
        """End it for certain, keeping progress; a clip that is finished by then is taken in."""
        self.worker.close(timeout_s=timeout_s)
        if self._arrival is not None:
            self._arrival.wait()
        with suppress(ProjectError):
            self.check()
            take_in(self.project, self.clip_index)

    def lose(self) -> TrainingFailed:
        """Another process trains the clip since. The worker ends at once. Returns the ending."""
        self.worker.close(timeout_s=0.0)
        lost = lost_claim()
        self.ending = TrainingFailed(type(lost).__name__, *lost.parts())
        return self.ending

    # ---------------------------------------------------------------- events

    def poll(self, until_s: float) -> list[Event]:
        """New events, oldest first; an ending is the last. until_s: By time.monotonic, when to take no more."""
        if self._arrival is not None:
            return self._arrive(self._arrival)
        taken: list[Event] = []
        while self.ending is None and self._arrival is None:
            events = self.worker.poll()
            for event in events:
                self._take(event)
            taken += events
            if not events or time.monotonic() >= until_s:
                break
        if self._arrival is not None:
            taken.pop()  # it is trained once it is in its place
            taken += self._arrive(self._arrival)
        return taken

    def _arrive(self, arrival: Arrival) -> list[Event]:
        assert self._trained is not None
        n_refused, is_over = arrival.n_refused, arrival.poll()
        if is_over:
            error = arrival.error
            said = None if error is None else TrainingFailed(type(error).__name__, *error.parts())
            self.ending = said or self._trained
            return [self.ending]
        if self.is_stopping and arrival.n_refused:
            self.ending = TrainingStopped(is_kept=True, step=self._trained.step)
            return [self.ending]
        if not n_refused and arrival.n_refused:
            self.stage = StageReported("Waiting for disk space", 1.0)
            title = f"Clip {self.clip_index} is trained, but could not be put in its place"
            return [WarningRaised(title, f"{arrival.error} It is saved, and this will be tried again."), self.stage]
        return []

    def _take(self, event: Event) -> None:
        match event:
            case WorkerReady(pid=pid, machine=machine):
                self.pid, self.machine = pid, machine
            case LoadReported():
                self.load = event.load
            case StageReported():
                self.stage = event
            case StepReported():
                self.last_step = event
                self.step, self.n_steps = event.step, event.n_steps
                if event.stage:  # takes the place of the preparation that went before
                    self.stage = StageReported(STAGE_WORDS.get(event.stage, event.stage), 1.0)
                if math.isfinite(event.loss):
                    append_thinned(self.curves.loss, (event.step, event.loss))
            case HeldOutMeasured():
                self.held_out_psnr = event.psnr
                append_thinned(self.curves.psnr, (event.step, event.psnr))
            case SnapshotWritten():
                file = self.project.files(self.clip_index).snapshot(event.revision)
                self.shown = ShownState(file, f"live-{self.number}-{event.revision}", is_live=True)
            case TrainingPaused():
                self.is_paused = True
            case TrainingResumed():
                self.is_paused = False
            case ClipTrained():
                self._trained = event
                is_endless = self.worker.job.is_window_open
                self._arrival = Arrival(self.project, self.clip_index, is_endless=is_endless, check=self.check)
            case _ if isinstance(event, ENDINGS):
                self.ending = event
            case _:
                pass
