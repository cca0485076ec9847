"""TrainingService: which clip trains, which wait, and what the worker said last. Status is derived, never stored.

Owned by one thread. It knows no window and raises no notices: `poll` returns the events for whoever tells the user.
"""

from __future__ import annotations

import logging
import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from app.project import Project, read_metrics
from app.status import ClipStatus, TrainingStatus
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
from engine.capture.clip import Clip
from engine.errors import ProjectError
from engine.model.clip_state import read_clip_header

logger = logging.getLogger(__name__)

Launch = Callable[[TrainJob, Project], Worker]
STAGE_WORDS = {
    "static": "Learning what stands still",
    "joint": "Learning what moves",
    "source": "Learning what is new",
}
MAX_HISTORY = 4000
"""Points of a curve; beyond that every second one goes."""
CLOSE_TIMEOUT_S = 5.0


@dataclass
class ClipProgress:
    """What is known of one clip; curves and files, no worker."""

    state: str = "untrained"
    step: int = 0
    n_steps: int = 0
    held_out_psnr: float | None = None
    loss_history: list[tuple[int, float]] = field(default_factory=list)
    psnr_history: list[tuple[int, float]] = field(default_factory=list)
    file: Path | None = None
    revision: str = ""
    """Names the state in `file`; empty when there is none to show."""


class TrainingService:
    """Queue and worker of one project.

    Args:
        project: Where clips go.
        clips: All clips of the capture.
        holdout: Camera indices never trained on.
        launch: Starts a worker; a process by default.
        is_window_open: Passed on to workers, which then leave room for it.
    """

    def __init__(
        self,
        project: Project,
        clips: Sequence[Clip],
        *,
        holdout: Sequence[int],
        launch: Launch = ProcessWorker,
        is_window_open: bool = True,
    ) -> None:
        self.project, self.clips, self.holdout = project, list(clips), tuple(holdout)
        self._launch, self._is_window_open = launch, is_window_open
        self.queue: deque[int] = deque()
        self.worker: Worker | None = None
        self.progress = [ClipProgress() for _ in self.clips]
        self._stage = StageReported("", 0.0)
        self._step: StepReported | None = None
        self._is_ready = False
        self._is_paused = False
        self._is_stopping = False
        self._ending: Event | None = None
        self._shown_clip: int | None = None
        self._n_runs = 0  # in the names of live states: each worker counts its own from one
        for clip in self.clips:
            self.read_clip(clip.clip_index)

    # ---------------------------------------------------------------- what lies on disk

    def read_clip(self, clip_index: int) -> None:
        """Look at the clip's files: trained, stale, stopped half way, or nothing."""
        known = self.progress[clip_index]
        trained, checkpoint = self.project.clip_path(clip_index), self.project.checkpoint_path(clip_index)
        header = read_clip_header(trained)
        known.state, known.file, known.revision = "untrained", None, ""
        if header is not None:
            known.state = "stale" if self._is_stale(clip_index, header) else "trained"
            known.file, known.revision = trained, f"trained-{header.get('fingerprint', '')}"
        unfinished = read_clip_header(checkpoint)
        if unfinished is not None and (header is None or known.state == "stale"):
            header = unfinished
            known.state = "paused"
            known.file, known.revision = checkpoint, f"stopped-{header.get('step', 0)}-{header.get('fingerprint', '')}"
        known.step, known.n_steps = (int(header[key]) for key in ("step", "n_steps")) if header else (0, 0)
        rows = read_metrics(self.project.metrics_path(clip_index))
        known.loss_history = thinned([(row["step"], row["loss"]) for row in rows if _is_number(row.get("loss"))])
        known.psnr_history = thinned(
            [(row["step"], row["held_out_psnr"]) for row in rows if _is_number(row.get("held_out_psnr"))]
        )
        known.held_out_psnr = known.psnr_history[-1][1] if known.psnr_history else None
        if known.state == "stale":
            known.file, known.revision = None, ""  # it cannot be shown without the reference it was trained on

    def _is_stale(self, clip_index: int, header: dict[str, Any]) -> bool:
        """Whether what the clip was trained on is not there any more: its reference, or the clip that it goes on from.

        Clips that go on from each other form a chain: one that is stale makes all after it stale.
        """
        if header.get("role") == "source":
            reference = read_clip_header(self.project.reference_path)
            if reference is None or reference.get("fingerprint") != header.get("reference_fingerprint"):
                return True
        if "previous_fingerprint" not in header:
            return False
        before = self.project.previous_index(clip_index)
        previous = read_clip_header(self.project.clip_path(before))
        if previous is None or previous.get("fingerprint") != header["previous_fingerprint"]:
            return True
        return self._is_stale(before, previous)

    @property
    def _goes_on(self) -> bool:
        """Whether clips begin with what the clip before has learned."""
        config = self.project.settings.config()
        return config.field == "continue" or config.start == "previous"

    # ---------------------------------------------------------------- commands

    @property
    def next_clip_index(self) -> int | None:
        """The first clip that is neither finished nor on its way; None when there is none."""
        taken = {*self.queue, *(() if self.worker is None else (self.worker.job.clip_index,))}
        first = self.project.settings.reference_clip
        for clip_index in (first, *(i for i in range(len(self.progress)) if i != first)):
            known = self.progress[clip_index]
            if known.state != "trained" and clip_index not in taken:
                return clip_index
        return None

    @property
    def can_train_next(self) -> bool:
        """Whether training the next clip would start something."""
        return self.project.is_writable and self.next_clip_index is not None and not self._is_stopping

    def enqueue(self, clip_index: int) -> None:
        """Train a clip when its turn comes; at once when nothing else does.

        Raises:
            ProjectError: The project is read-only, there is no such clip, or its reference is missing.
        """
        self.project.check_writable()
        if not 0 <= clip_index < len(self.clips):
            raise ProjectError(f"There is no clip {clip_index}; clips are 0 to {len(self.clips) - 1}.")
        coming = {*self.queue, *(() if self.worker is None else (self.worker.job.clip_index,))}
        if clip_index in coming:
            return
        base = self.project.inherited_index(clip_index)
        if base is not None and not self.project.is_trained(base) and base not in coming:
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
            self.read_clip(self.worker.job.clip_index)
            self.worker = None

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
        )
        self._stage, self._step, self._ending = StageReported("", 0.0), None, None
        self._is_ready = self._is_paused = self._is_stopping = False
        self._shown_clip = clip_index
        known = self.progress[clip_index]
        if not self.project.checkpoint_path(clip_index).is_file():
            known.loss_history, known.psnr_history, known.held_out_psnr = [], [], None
            known.step = 0
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
                self._take(event, self.worker.job.clip_index)
            taken += events
            if not events or time.monotonic() >= until_s or isinstance(events[-1], ENDINGS):
                break
        if taken and isinstance(taken[-1], ENDINGS):
            self._end(taken[-1])
        return taken

    def _take(self, event: Event, clip_index: int) -> None:
        known = self.progress[clip_index]
        match event:
            case WorkerReady():
                self._is_ready = True
            case StageReported():
                self._stage = event
            case StepReported():
                self._step = event
                known.step, known.n_steps = event.step, event.n_steps
                if event.stage:  # takes the place of the preparation that went before
                    self._stage = StageReported(STAGE_WORDS.get(event.stage, event.stage), 1.0)
                if math.isfinite(event.loss):
                    append_thinned(known.loss_history, (event.step, event.loss))
            case HeldOutMeasured():
                known.held_out_psnr = event.psnr
                append_thinned(known.psnr_history, (event.step, event.psnr))
            case SnapshotWritten():
                known.file, known.revision = Path(event.path), f"live-{self._n_runs}-{event.revision}"
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
        is_reference = clip_index == self.project.settings.reference_clip
        for index in range(len(self.clips)) if is_reference or self._goes_on else (clip_index,):
            self.read_clip(index)  # a new reference makes the others stale, a new clip those that went on from it
        if isinstance(ending, TrainingFailed | WorkerDied):
            self.progress[clip_index].state = "failed"
            if is_reference and not self.project.is_trained(clip_index):
                self.queue.clear()  # what waits needs the reference
        if isinstance(ending, ClipTrained) and ending.held_out_psnr is not None:
            self.progress[clip_index].held_out_psnr = ending.held_out_psnr
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
        clip_index = self._shown_clip
        curve_clip = clip_index if self.worker is not None or viewed_clip is None else viewed_clip
        curves = None if curve_clip is None else self.progress[curve_clip]
        known = None if clip_index is None else self.progress[clip_index]
        state, step = self.state, self._step
        rate = step.steps_per_s if step is not None else 0.0
        left = 0 if step is None else step.n_steps - step.step
        return TrainingStatus(
            state=state,
            clip_index=clip_index,
            step=0 if known is None else known.step,
            n_steps=0 if known is None else known.n_steps,
            progress=self._stage.done if step is None else step.step / max(step.n_steps, 1),
            stage=self._stage.stage,
            message=self._message(state),
            steps_per_s=rate if state == "running" else 0.0,
            eta_s=left / rate if rate > 0 and state == "running" else None,
            curve_clip_index=curve_clip,
            gradient_norm=step.gradient_norm if step is not None and math.isfinite(step.gradient_norm) else None,
            loss_history=() if curves is None else curves.loss_history,
            psnr_history=() if curves is None else curves.psnr_history,
            can_train_next=self.can_train_next,
            next_clip_index=self.next_clip_index,
            queue=tuple(self.queue),
        )

    def _message(self, state: str) -> str:
        if state == "failed":
            return (
                self._ending.message if isinstance(self._ending, TrainingFailed) else "The worker ended unexpectedly."
            )
        return self._stage.message if self.worker is not None else ""

    def clip_statuses(self, counts: dict[int, tuple[int, int]]) -> list[ClipStatus]:
        """One status per clip. `counts` holds inherited and own anchors of the clips that were loaded."""
        state = self.state
        running = None if self.worker is None else self.worker.job.clip_index
        statuses = []
        for clip_index, known in enumerate(self.progress):
            shown = known.state
            if clip_index in self.queue:
                shown = "queued"
            if clip_index == running:
                shown = {"starting": "preparing", "preparing": "preparing", "paused": "paused"}.get(state, "training")
            share = known.step / known.n_steps if known.n_steps else 0.0
            n_inherited, n_own = counts.get(clip_index, (0, 0))
            statuses.append(
                ClipStatus(
                    state=shown,
                    progress=1.0 if shown == "trained" else share,
                    held_out_psnr=known.held_out_psnr,
                    n_inherited=n_inherited,
                    n_own=n_own,
                )
            )
        return statuses


def append_thinned(history: list[tuple[int, float]], point: tuple[int, float]) -> None:
    """Append a point; a list that grew too long loses every second one."""
    history.append(point)
    if len(history) > MAX_HISTORY:
        del history[1:-1:2]


def thinned(history: list[tuple[int, float]]) -> list[tuple[int, float]]:
    """At most MAX_HISTORY points, first and last kept."""
    while len(history) > MAX_HISTORY:
        del history[1:-1:2]
    return history


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and math.isfinite(value)
