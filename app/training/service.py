"""TrainingService: which clip trains, which wait, and what the worker said last. Status is derived, never stored.

Owned by one thread. It knows no window and raises no notices: `poll` returns the events for whoever tells the user.
What lies on disk is app.project.clips.clip_catalog's business; the training at hand never hides it.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from app.project.clips.clip_catalog import ClipCatalog
from app.project.clips.clip_versions import recovery_hint
from app.project.project import Project
from app.status import ClipStatus, TrainingStatus
from app.training.curves import CurveReader, Curves, append_thinned, read_curves
from app.training.messages import (
    ENDINGS,
    LIVE_VIEWS,
    ClipTrained,
    Event,
    HeldOutMeasured,
    Pause,
    Resume,
    SetSnapshots,
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
from app.training.own_settings import with_own
from app.training.process import ProcessWorker, Worker
from app.training.stage_order import stage_number
from app.training.train_queue import OwnSettings, TrainQueue, drop_hopeless, needed_clips
from engine.capture.clip import Clip
from engine.errors import ProjectError
from engine.training.preparation.stages import remove_stages

logger = logging.getLogger(__name__)

Launch = Callable[[TrainJob, Project], Worker]
STAGE_WORDS = {
    "static": "Learning the static scene",
    "joint": "Learning motion",
    "source": "Learning new content",
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
        is_live: Whether it is a snapshot, which its worker replaces and removes as it continues.
        reference_file: The clip it is shown with, where that is not the project's reference as it is now.
    """

    file: Path
    revision: str
    is_live: bool = False
    reference_file: Path | None = None


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

    Attributes:
        queue: Clips that wait.
        live_view: How often workers write snapshots, one of LIVE_VIEWS.
        is_ending_after: Whether the queue is held when the clip that trains has ended.
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
        self.queue = TrainQueue()
        self.live_view = "live"
        self.is_ending_after = False
        self.worker: Worker | None = None
        self.curves = CurveReader() if curves is None else curves
        self._owns_curves = curves is None
        self._begun: dict[int, OwnSettings] = {}  # settings of their own that unfinished clips were begun with
        self._dropped: list[int] = []
        self._run: Run | None = None
        self._worker_pid: int | None = None
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

    @property
    def worker_pid(self) -> int | None:
        """Process of the worker; None while there is none, or before it has said so."""
        return None if self.worker is None else self._worker_pid

    def is_finished(self, clip_index: int) -> bool:
        """Whether a finished clip would be replaced by training this one: it is trained, or damaged."""
        return 0 <= clip_index < len(self.clips) and self.catalog[clip_index].state in ("trained", "damaged")

    def shown_state(self, clip_index: int) -> ShownState | None:
        """The state of a clip to look at: the newest snapshot while it trains, else what is on disk, if anything; None
        for one that there is no more, since clips are cut otherwise now."""
        if not 0 <= clip_index < len(self.clips):
            return None
        if clip_index == self.running_clip and self._run is not None and self._run.file is not None:
            return ShownState(self._run.file, self._run.revision, is_live=True)
        record = self.catalog[clip_index]
        return None if record.file is None else ShownState(record.file, record.revision)

    # ---------------------------------------------------------------- commands

    @property
    def next_clip_index(self) -> int | None:
        """The first clip that is neither finished nor on its way; None when there is none.

        A damaged clip is not among them, nor one that cannot be trained without it: that is for the user to decide.
        Where the queue is held, it is the first of that.
        """
        if self.worker is None and self.queue:
            return next(iter(self.queue))
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

    @property
    def unfinished(self) -> list[int]:
        """Clips that are not finished and up to date and can be trained, in the order of training; also those on
        their way."""
        order = self.catalog.order
        records = [(index, self.catalog[index]) for index in order]
        return [
            index
            for index, record in records
            if record.state not in ("trained", "damaged") and record.blocked_by is None
        ]

    @property
    def stale(self) -> list[int]:
        """Clips that are out of date and can be trained again, in the order of training; also those on their way."""
        return [index for index in self.unfinished if self.catalog[index].state == "stale"]

    def enqueue(self, clip_index: int, own: OwnSettings | None = None) -> None:
        """Train a clip when its turn comes; at once when nothing else does. Who trains a finished one has asked.

        Args:
            own: Settings that differ from the project's; the training then begins afresh.
        Raises:
            ProjectError: The project is read-only, there is no such clip, a clip that it needs is missing or damaged,
                or a setting cannot differ between clips.
        """
        self.project.check_writable()
        if not 0 <= clip_index < len(self.clips):
            raise ProjectError(f"There is no clip {clip_index}; clips are 0 to {len(self.clips) - 1}.")
        if own:
            with_own(self.project, own)
        coming = {*self.queue, self.running_clip}
        if clip_index in coming and (clip_index == self.running_clip or own is None):
            return
        for base in needed_clips(self.project, clip_index):
            self._check_needed(clip_index, base, coming)
        self._add(clip_index, own)
        self.go_on()

    def _check_needed(self, clip_index: int, base: int, coming: set[int | None]) -> None:
        kind = "the reference clip" if base == self.project.settings.reference_clip else "clip"
        if base in coming:
            return
        if self.catalog[base].state == "damaged":
            raise ProjectError(
                f"Clip {clip_index} needs {kind} {base}, whose file is damaged.",
                hint=recovery_hint(self.project, base),
                path=self.project.clip_path(base),
            )
        if not self.project.is_trained(base):
            raise ProjectError(
                f"Clip {clip_index} needs {kind} {base}, which is not trained.", hint=f"Train clip {base} first."
            )

    def _add(self, clip_index: int, own: OwnSettings | None = None) -> None:
        if self.worker is None and not self.queue:
            self.queue.forget_done()
        self.queue.add(clip_index, own)

    def enqueue_all(self, clip_indices: Sequence[int]) -> list[int]:
        """Train those of these clips that are not finished, in the order of training; what they need comes first.

        Returns:
            Clips that were left out, because they or what they need is damaged.
        Raises:
            ProjectError: The project is read-only.
        """
        self.project.check_writable()
        due, left_out, config = set(self.unfinished), [], self.project.settings.config()
        rank = {index: place for place, index in enumerate(self.catalog.order)}  # a clip comes after all that it needs
        coming: set[int | None] = {*self.queue, self.running_clip}
        for index in sorted({index for index in clip_indices if index in rank}, key=rank.__getitem__):
            chain, open_ends = set[int](), [index]
            while open_ends:
                one = open_ends.pop()
                if self.catalog[one].state != "trained" and one not in chain and one not in coming:
                    chain.add(one)
                    open_ends += needed_clips(self.project, one, config)
            if not due.issuperset(chain):
                left_out.append(index)
                continue
            for one in sorted(chain, key=rank.__getitem__):
                self._add(one)
            coming |= chain
        self.go_on()
        return left_out

    def go_on(self) -> None:
        """Train what waits in a queue that was held."""
        self.queue.is_held = False
        self._start_next()

    def stop_after_clip(self, is_wanted: bool) -> None:
        """Hold the queue when the clip that trains has ended, or not after all."""
        self.is_ending_after = is_wanted and self.worker is not None

    def set_live_view(self, mode: str) -> None:
        """How often snapshots are written, from now on; reaches a running worker, which does not wait for it."""
        if mode not in LIVE_VIEWS:
            raise ValueError(f"the live view is one of {', '.join(LIVE_VIEWS)}, not {mode!r}")
        self.live_view = mode
        if self.worker is not None:
            self.worker.send(SetSnapshots(mode))

    def drop_hopeless(self) -> list[int]:
        """Take out of the queue what cannot be trained any more. Returns it."""
        return drop_hopeless(self.queue, self.running_clip, self.project, self.catalog)

    def take_dropped(self) -> list[int]:
        """Clips that left the queue because what they need cannot come, once."""
        dropped, self._dropped = self._dropped, []
        return dropped

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
        self.is_ending_after = False
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
        """End the worker, keeping progress."""
        self.queue.clear()
        if self.worker is not None:
            self.worker.close(timeout_s=timeout_s)
            self.catalog.update(self.worker.job.clip_index)
            self.worker = None
        if self._owns_curves:
            self.curves.close()

    def _start_next(self) -> None:
        if self.worker is not None or not self.queue or self.queue.is_held:
            return
        clip_index, own = self.queue.take()
        if own is not None:
            self._begin_afresh(clip_index, own)
        overrides = dict(self.project.settings.overrides)
        if self._begun.get(clip_index):
            overrides = with_own(self.project, self._begun[clip_index])
        settings = self.project.settings
        job = TrainJob(
            project=str(self.project.folder),
            capture=settings.capture,
            scale=settings.scale,
            clip_length=settings.clip_length,
            clip_index=clip_index,
            holdout=self.holdout,
            seed=settings.seed,
            overrides=overrides,
            is_window_open=self._is_window_open,
            follow_links=settings.follow_links,
            live_view=self.live_view,
            frames=settings.frames,
        )
        self._stage, self._step, self._ending = StageReported("", 0.0), None, None
        self._is_ready = self._is_paused = self._is_stopping = False
        self._worker_pid = None
        record = self.catalog[clip_index]
        self._run = Run(clip_index)
        if record.resume_step is not None:
            curves = read_curves(self.project.curve_path(clip_index, is_finished=False))
            self._run = Run(clip_index, record.resume_step, record.resume_n_steps, curves=curves)
            self._run.held_out_psnr = curves.psnr[-1][1] if curves.psnr else None
        self._n_runs += 1
        self.worker = self._launch(job, self.project)

    def _begin_afresh(self, clip_index: int, own: OwnSettings) -> None:
        """Progress with other settings is not a start."""
        self._begun[clip_index] = own
        self.project.discard_progress(clip_index)
        remove_stages(self.project.prep_dir, clip_index)
        self.catalog.update(clip_index)

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
            case WorkerReady(pid=pid):
                self._is_ready, self._worker_pid = True, pid
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
        self.queue.note_end(0 if self._run is None else self._run.n_steps)
        if isinstance(ending, ClipTrained):
            self._begun.pop(clip_index, None)
        if isinstance(ending, TrainingFailed | WorkerDied):
            self.queue.failed[clip_index] = self._message("failed")
        if self.is_ending_after and self.queue:
            self.queue.is_held = True
        self.is_ending_after = False
        self._dropped += self.drop_hopeless()
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

    @property
    def steps_of_run(self) -> tuple[int, int]:
        """Steps done and all steps of the clip that trains; zeros before it has said so, and while none does."""
        return (0, 0) if self.worker is None or self._run is None else (self._run.step, self._run.n_steps)

    @property
    def eta_s(self) -> float | None:
        """Seconds until the clip that trains is finished; None when unknown."""
        step = self._step
        if step is None or step.steps_per_s <= 0 or self.state != "running":
            return None
        return (step.n_steps - step.step) / step.steps_per_s

    def status(self, viewed_clip: int | None = None) -> TrainingStatus:
        """Everything about the training as one value.

        Args:
            viewed_clip: Whose curves to show while nothing trains.
        """
        run, state, step = self._run, self.state, self._step
        clip_index = None if run is None else run.clip_index
        curve_clip = clip_index if self.worker is not None or viewed_clip is None else viewed_clip
        curves = None if curve_clip is None else self.curves_of(curve_clip)
        rate = step.steps_per_s if step is not None else 0.0
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
            eta_s=self.eta_s,
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

    def curves_of(self, clip_index: int) -> Curves | None:
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
        if self._statuses_of != (self.catalog.revision, queued, running, tuple(self.queue.failed)):
            self._statuses = [self._clip_status(index, None) for index in range(len(self.clips))]
            self._statuses_of = (self.catalog.revision, queued, running, tuple(self.queue.failed))
        if running is not None:
            self._statuses[running] = self._clip_status(running, live_counts)
        return list(self._statuses)

    def _clip_status(self, clip_index: int, live_counts: tuple[int, int] | None) -> ClipStatus:
        record, run = self.catalog[clip_index], self._run
        n_inherited, n_own = record.n_anchors if live_counts is None else live_counts
        shown, step, n_steps, reason = record.state, record.step, record.n_steps, record.reason
        psnr, is_whole = record.held_out_psnr, record.held_out_whole
        if clip_index == self.running_clip and run is not None:
            words = {"starting": "preparing", "preparing": "preparing", "paused": "paused"}
            shown, step, n_steps = words.get(self.state, "training"), run.step, run.n_steps
            if run.held_out_psnr is not None:
                psnr, is_whole = run.held_out_psnr, False
        elif clip_index in self.queue:
            shown = "queued"
        elif clip_index in self.queue.failed and shown in ("untrained", "stopped"):
            shown = "failed"
            reason = self.queue.failed[clip_index]
        share = step / n_steps if n_steps else 0.0
        return ClipStatus(
            state=shown,
            progress=1.0 if shown == "trained" else min(share, 1.0),
            held_out_psnr=psnr,
            n_inherited=n_inherited,
            n_own=n_own,
            resume_step=record.resume_step,
            reason=reason,
            exposure_change=record.exposure_change,
            held_out_whole=is_whole,
        )
