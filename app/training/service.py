"""TrainingService: which clip trains, which wait, and what the worker said last. Status is derived, never stored.

Owned by one thread. It knows no window and raises no notices: `poll` returns the events for whoever tells the user.
What lies on disk is app.project.clip_catalog's business; the training at hand stands beside it and never hides it.
"""

from __future__ import annotations

import logging
import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from app.project.clip_catalog import ClipCatalog
from app.project.project import Project
from app.status import ClipStatus, TrainingStatus
from app.training.curves import CurveReader, Curves, append_thinned, read_curves
from app.training.messages import (
    ENDINGS,
    ClipTrained,
    Event,
    HeldOutMeasured,
    Pause,
    Resume,
    SnapshotConsumed,
    SnapshotNow,
    SnapshotWritten,
    StageReported,
    StepReported,
    Stop,
    TrainingFailed,
    TrainingPaused,
    TrainingResumed,
    TrainJob,
    WorkerDied,
    WorkerReady,
)
from app.training.process import ProcessWorker, Worker
from app.training.stage_order import stage_number
from engine.capture.clip import Clip
from engine.errors import ProjectError

logger = logging.getLogger(__name__)

Launch = Callable[[TrainJob, Project], Worker]
STAGE_WORDS = {
    "static": "Learning what stands still",
    "joint": "Learning what moves",
    "source": "Learning what is new",
}
CLOSE_TIMEOUT_S = 5.0


@dataclass
class Run:
    """The training at hand, or the last one: what its worker said so far.

    Attributes:
        file, revision: Its newest snapshot; None and empty before the first.
    """

    clip_index: int
    step: int = 0
    n_steps: int = 0
    held_out_psnr: float | None = None
    curves: Curves = field(default_factory=Curves)
    file: Path | None = None
    revision: str = ""


@dataclass(frozen=True, slots=True)
class ShownState:
    """A state of a clip as a file.

    Attributes:
        revision: Names the state.
        is_live: Whether it is a snapshot, which its worker replaces and removes as it goes on.
    """

    file: Path
    revision: str
    is_live: bool = False


class TrainingService:
    """Queue and worker of one project.

    Args:
        project: Where clips go.
        clips: All clips of the capture.
        holdout: Camera indices never trained on.
        launch: Starts a worker; a process by default.
        is_window_open: Passed on to workers, which then leave room for it.
        catalog: What lies on disk; read here, which takes a while in a long project, when None.
        curves: Reads the curves of clips that are looked at; stays open when the service is closed.
    """

    def __init__(
        self,
        project: Project,
        clips: Sequence[Clip],
        *,
        holdout: Sequence[int],
        launch: Launch = ProcessWorker,
        is_window_open: bool = True,
        catalog: ClipCatalog | None = None,
        curves: CurveReader | None = None,
    ) -> None:
        self.project, self.clips, self.holdout = project, list(clips), tuple(holdout)
        self._launch, self._is_window_open = launch, is_window_open
        self.catalog = ClipCatalog(project, len(self.clips)) if catalog is None else catalog
        self.queue: deque[int] = deque()
        self.worker: Worker | None = None
        self.curves = CurveReader() if curves is None else curves
        self._owns_curves = curves is None
        self._failed: set[int] = set()
        self._run: Run | None = None
        self._stage = StageReported("", 0.0)
        self._step: StepReported | None = None
        self._is_ready = False
        self._is_paused = False
        self._is_stopping = False
        self._ending: Event | None = None
        self._n_runs = 0  # in the names of live states: each worker counts its own from one
        self._statuses: list[ClipStatus] = []
        self._statuses_of: tuple[object, ...] = ()

    @property
    def running_clip(self) -> int | None:
        """The clip that trains; None while nothing does."""
        return None if self.worker is None else self.worker.job.clip_index

    def is_finished(self, clip_index: int) -> bool:
        """Whether a finished clip would be replaced by training this one: it is trained, or damaged."""
        return 0 <= clip_index < len(self.clips) and self.catalog[clip_index].state in ("trained", "damaged")

    def shown_state(self, clip_index: int) -> ShownState | None:
        """The state of a clip to look at: the newest snapshot while it trains, else what is on disk, if anything."""
        if clip_index == self.running_clip and self._run is not None and self._run.file is not None:
            return ShownState(self._run.file, self._run.revision, is_live=True)
        record = self.catalog[clip_index]
        return None if record.file is None else ShownState(record.file, record.revision)

    # ---------------------------------------------------------------- commands

    @property
    def next_clip_index(self) -> int | None:
        """The first clip that is neither finished nor on its way; None when there is none.

        A damaged clip is not among them, nor one that cannot be trained without it: that is for the user to decide.
        """
        taken = {*self.queue, self.running_clip}
        for clip_index in self.catalog.order:
            record = self.catalog[clip_index]
            is_due = record.state not in ("trained", "damaged") and record.blocked_by is None
            if is_due and clip_index not in taken:
                return clip_index
        return None

    @property
    def can_train_next(self) -> bool:
        """Whether training the next clip would start something."""
        return self.project.is_writable and self.next_clip_index is not None and not self._is_stopping

    def enqueue(self, clip_index: int) -> None:
        """Train a clip when its turn comes; at once when nothing else does. Who trains a finished one has asked.

        Raises:
            ProjectError: The project is read-only, there is no such clip, or its reference is missing or damaged.
        """
        self.project.check_writable()
        if not 0 <= clip_index < len(self.clips):
            raise ProjectError(f"There is no clip {clip_index}; clips are 0 to {len(self.clips) - 1}.")
        coming = {*self.queue, self.running_clip}
        if clip_index in coming:
            return
        base = self.project.inherited_index(clip_index)
        if base is not None and base not in coming:
            if self.catalog[base].state == "damaged":
                raise ProjectError(
                    f"Clip {clip_index} needs the reference clip {base}, whose file is damaged.",
                    hint=f"Restore it from a copy, or train clip {base} again.",
                    path=self.project.clip_path(base),
                )
            if not self.project.is_trained(base):
                raise ProjectError(
                    f"Clip {clip_index} needs the reference clip {base}, which is not trained.",
                    hint=f"Train clip {base} first.",
                )
        self.queue.append(clip_index)
        self._start_next()

    def pause(self) -> None:
        """Hold after the current step."""
        if self.worker is not None and not self._is_stopping:
            self._is_paused = True
            self.worker.send(Pause())

    def resume(self) -> None:
        """Go on."""
        if self.worker is not None and self._is_paused:
            self._is_paused = False
            self.worker.send(Resume())

    def stop(self, *, keep: bool = True) -> None:
        """End the running clip and empty the queue."""
        self.queue.clear()
        if self.worker is not None:
            self._is_stopping = True
            self.worker.send(Stop(keep=keep))

    def snapshot_now(self) -> None:
        """Ask for a fresh state, for instance because the user looks at this clip now."""
        if self.worker is not None:
            self.worker.send(SnapshotNow())

    def snapshot_consumed(self, clip_index: int, revision: int) -> None:
        """The live state of this revision was read."""
        if self.worker is not None and self.worker.job.clip_index == clip_index:
            self.worker.send(SnapshotConsumed(revision))

    def close(self, *, timeout_s: float = CLOSE_TIMEOUT_S) -> None:
        """End the worker, keeping what was learned."""
        self.queue.clear()
        if self.worker is not None:
            self.worker.close(timeout_s=timeout_s)
            self.catalog.update(self.worker.job.clip_index)
            self.worker = None
        if self._owns_curves:
            self.curves.close()

    def _start_next(self) -> None:
        if self.worker is not None or not self.queue:
            return
        clip_index = self.queue.popleft()
        settings = self.project.settings
        job = TrainJob(
            project=str(self.project.folder),
            capture=settings.capture,
            scale=settings.scale,
            clip_length=settings.clip_length,
            clip_index=clip_index,
            holdout=self.holdout,
            seed=settings.seed,
            overrides=dict(settings.overrides),
            is_window_open=self._is_window_open,
            follow_links=settings.follow_links,
        )
        self._stage, self._step, self._ending = StageReported("", 0.0), None, None
        self._is_ready = self._is_paused = self._is_stopping = False
        self._failed.discard(clip_index)
        record = self.catalog[clip_index]
        self._run = Run(clip_index)
        if record.resume_step is not None:
            curves = read_curves(self.project.curve_path(clip_index, is_finished=False))
            self._run = Run(clip_index, record.resume_step, record.resume_n_steps, curves=curves)
            self._run.held_out_psnr = curves.psnr[-1][1] if curves.psnr else None
        self._n_runs += 1
        self.worker = self._launch(job, self.project)

    # ---------------------------------------------------------------- events

    def poll(self, *, budget_s: float = 0.002) -> list[Event]:
        """Take what the worker said; start the next clip when one ended. Returns the events, oldest first."""
        if self.worker is None:
            return []
        until_s = time.monotonic() + budget_s
        taken: list[Event] = []
        while self.worker is not None:
            events = self.worker.poll()
            for event in events:
                self._take(event)
            taken += events
            if not events or time.monotonic() >= until_s or isinstance(events[-1], ENDINGS):
                break
        if taken and isinstance(taken[-1], ENDINGS):
            self._end(taken[-1])
        return taken

    def _take(self, event: Event) -> None:
        run = self._run
        assert run is not None
        match event:
            case WorkerReady():
                self._is_ready = True
            case StageReported():
                self._stage = event
            case StepReported():
                self._step = event
                run.step, run.n_steps = event.step, event.n_steps
                if event.stage:  # takes the place of the preparation that went before
                    self._stage = StageReported(STAGE_WORDS.get(event.stage, event.stage), 1.0)
                if math.isfinite(event.loss):
                    append_thinned(run.curves.loss, (event.step, event.loss))
            case HeldOutMeasured():
                run.held_out_psnr = event.psnr
                append_thinned(run.curves.psnr, (event.step, event.psnr))
            case SnapshotWritten():
                run.file, run.revision = Path(event.path), f"live-{self._n_runs}-{event.revision}"
            case TrainingPaused():
                self._is_paused = True
            case TrainingResumed():
                self._is_paused = False
            case _:
                pass

    def _end(self, ending: Event) -> None:
        assert self.worker is not None
        clip_index = self.worker.job.clip_index
        self.worker.close(timeout_s=0.5)
        self.worker = None
        self._ending = ending
        self._is_paused = self._is_stopping = False
        self.catalog.update(clip_index)  # also sees what is out of date by it
        if isinstance(ending, TrainingFailed | WorkerDied):
            self._failed.add(clip_index)
            if clip_index == self.project.settings.reference_clip and not self.project.is_trained(clip_index):
                self.queue.clear()  # what waits needs the reference
        self._start_next()

    # ---------------------------------------------------------------- status

    @property
    def state(self) -> str:
        """See TrainingStatus.state."""
        if self.worker is None:
            return "failed" if isinstance(self._ending, TrainingFailed | WorkerDied) else "idle"
        if self._is_stopping:
            return "stopping"
        if self._is_paused:
            return "paused"
        if not self._is_ready:
            return "starting"
        return "preparing" if self._step is None else "running"

    def status(self, viewed_clip: int | None = None) -> TrainingStatus:
        """Everything about the training as one value.

        Args:
            viewed_clip: Whose curves to show while nothing trains.
        """
        run, state, step = self._run, self.state, self._step
        clip_index = None if run is None else run.clip_index
        curve_clip = clip_index if self.worker is not None or viewed_clip is None else viewed_clip
        curves = None if curve_clip is None else self._curves(curve_clip)
        rate = step.steps_per_s if step is not None else 0.0
        left = 0 if step is None else step.n_steps - step.step
        upcoming = self.next_clip_index
        settings = self.project.settings
        is_reference = clip_index == settings.reference_clip or settings.config().independent
        number, n_stages = stage_number(self._stage.stage, is_reference=is_reference) if step is None else (0, 0)
        return TrainingStatus(
            state=state,
            clip_index=clip_index,
            step=0 if run is None else run.step,
            n_steps=0 if run is None else run.n_steps,
            progress=self._stage.done if step is None else step.step / max(step.n_steps, 1),
            stage=self._stage.stage,
            stage_number=number,
            n_stages=n_stages,
            message=self._message(state),
            steps_per_s=rate if state == "running" else 0.0,
            eta_s=left / rate if rate > 0 and state == "running" else None,
            curve_clip_index=curve_clip,
            gradient_norm=step.gradient_norm if step is not None and math.isfinite(step.gradient_norm) else None,
            loss_history=() if curves is None else curves.loss,
            psnr_history=() if curves is None else curves.psnr,
            can_train_next=self.project.is_writable and upcoming is not None and not self._is_stopping,
            next_clip_index=upcoming,
            resume_step=None if upcoming is None else self.catalog[upcoming].resume_step,
            queue=tuple(self.queue),
        )

    def _message(self, state: str) -> str:
        if state == "failed":
            return (
                self._ending.message if isinstance(self._ending, TrainingFailed) else "The worker ended unexpectedly."
            )
        return self._stage.message if self.worker is not None else ""

    def _curves(self, clip_index: int) -> Curves | None:
        """Of the training at hand once it has any; otherwise those on disk, None until they are read."""
        run = self._run
        if run is not None and clip_index == run.clip_index:
            is_over = self.worker is None and not isinstance(self._ending, ClipTrained)
            if not is_over and (run.curves.loss or run.curves.psnr):
                return run.curves
        state = self.catalog[clip_index].state
        return self.curves.curves(
            self.project.curve_path(clip_index, is_finished=state not in ("stopped", "untrained"))
        )

    def clip_statuses(self, live_counts: tuple[int, int] | None) -> list[ClipStatus]:
        """One status per clip.

        Only what has changed is remade: this is asked for at every change of the picture, and clips may be thousands.

        Args:
            live_counts: Inherited and own anchors of the running clip, if a state of it was loaded.
        """
        queued = tuple(self.queue)
        running = self.running_clip
        if self._statuses_of != (self.catalog.revision, queued, running, len(self._failed)):
            self._statuses = [self._clip_status(index, None) for index in range(len(self.clips))]
            self._statuses_of = (self.catalog.revision, queued, running, len(self._failed))
        if running is not None:
            self._statuses[running] = self._clip_status(running, live_counts)
        return list(self._statuses)

    def _clip_status(self, clip_index: int, live_counts: tuple[int, int] | None) -> ClipStatus:
        record, run = self.catalog[clip_index], self._run
        n_inherited, n_own = record.n_anchors if live_counts is None else live_counts
        shown, step, n_steps, psnr = record.state, record.step, record.n_steps, record.held_out_psnr
        if clip_index == self.running_clip and run is not None:
            words = {"starting": "preparing", "preparing": "preparing", "paused": "paused"}
            shown, step, n_steps = words.get(self.state, "training"), run.step, run.n_steps
            psnr = record.held_out_psnr if run.held_out_psnr is None else run.held_out_psnr
        elif clip_index in self.queue:
            shown = "queued"
        elif clip_index in self._failed and shown in ("untrained", "stopped"):
            shown = "failed"
        share = step / n_steps if n_steps else 0.0
        return ClipStatus(
            state=shown,
            progress=1.0 if shown == "trained" else min(share, 1.0),
            held_out_psnr=psnr,
            n_inherited=n_inherited,
            n_own=n_own,
            resume_step=record.resume_step,
            reason=record.reason,
            exposure_change=record.exposure_change,
        )
