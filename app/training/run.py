"""TrainingRun: the loop around one clip's training. Obeys commands, reports, snapshots, keeps checkpoints.

It knows neither processes nor pipes: `worker` drives it in a process, `inline` inside poll().
"""

from __future__ import annotations

import logging
import math
import os
import statistics
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from app.background.memory import peak_mb
from app.project.clips.clip_versions import forget_oldest, set_aside
from app.project.clips.metrics_file import read_metrics
from app.project.clips.stage_seconds import memory_of, stages_of
from app.project.opening.project_access import open_project
from app.project.project import Project
from app.training.disk_retries import FolderWatch, ProjectGone, Refusals, Retries
from app.training.interface import MakeTraining, Training
from app.training.messages import (
    ClipTrained,
    Command,
    Event,
    HeldOutMeasured,
    Pause,
    Resume,
    SetSnapshots,
    SnapshotConsumed,
    SnapshotNow,
    StageReported,
    StepReported,
    Stop,
    TrainingFailed,
    TrainingPaused,
    TrainingResumed,
    TrainingStopped,
    TrainJob,
    WarningRaised,
    WorkerReady,
)
from app.training.rate import SmoothedRate
from app.training.snapshots import Cadence, SnapshotWriter, is_finite, keep_clip
from app.training.stage_watch import KEEPING, STARTING, TRAINING, StageWatch
from engine.children.kind import Unwanted
from engine.clip_files.clip_header import ClipFigures
from engine.clip_files.clip_state import read_clip_header
from engine.clip_files.compact import CompactClip
from engine.errors import DiskError, EngineError, NonFiniteLoss, ProjectError
from engine.progress import Progress, StepStats
from engine.storage.files import disk_error, open_to_append
from engine.storage.json_files import checked_line
from engine.training.preparation.stages import remove_stages

logger = logging.getLogger(__name__)

REPORT_EVERY_S = 0.1
SNAPSHOT_EVERY_S = 2.0
LOW_SNAPSHOT_EVERY_S = 10.0
"""With a live view that is low."""
SNAPSHOT_SHARE = 0.05
"""Share of the time that snapshots may cost."""
HELD_OUT_EVERY_S = 5.0
HELD_OUT_SHARE = 0.03
CHECKPOINT_EVERY_S = 25.0
"""From the start of one to the start of the next: a step and the writing included, a kill costs at most 30 s."""
CHECKPOINT_SHARE = 0.5
"""Only a disk on which writing takes longer than that delays the next one."""
METRICS_EVERY_S = 0.5


Receive = Callable[[float], Command | None]
"""The next command, waiting at most this many seconds. Raises Unwanted once nobody is left to send one."""
Send = Callable[[Event], None]


def _snapshot_cadence(live_view: str) -> Cadence:
    return Cadence(LOW_SNAPSHOT_EVERY_S if live_view == "low" else SNAPSHOT_EVERY_S, SNAPSHOT_SHARE)


class StopRequested(Exception):
    """Unwinds a preparation or a long step after Stop."""


class TrainingRun:
    """One clip, from the job to its end.

    Args:
        job: What to train.
        receive: Source of commands.
        send: Takes events.
        make_training: Builds the training; its report function stays valid for the whole run.
        can_wait: Whether to sit still while paused (a process) or to return at once (inline).
        clock: Seconds; tests bring their own.
    """

    def __init__(
        self,
        job: TrainJob,
        *,
        receive: Receive,
        send: Send,
        make_training: MakeTraining,
        can_wait: bool = True,
        n_threads: int = 1,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._job, self._receive, self._send, self._make = job, receive, send, make_training
        self._can_wait, self._n_threads, self._clock = can_wait, n_threads, clock
        self._training: Training | None = None
        self._project: Project | None = None
        self._is_paused = False
        self._stop: Stop | None = None
        self._is_in_step = False
        self._is_checkpointed_in_step = False
        self._reported: tuple[str, str, float] = ("", "", -math.inf)
        self._n_at_once = 1
        """Steps until numbers are read: about as many as go into REPORT_EVERY_S."""
        self._loss_sum, self._n_losses = 0.0, 0
        """Of the steps since the last report."""
        self._gradient_norms: list[float] = []
        """Of all steps of this process."""
        self._n_clipped = 0
        """Those of them whose gradients were scaled down."""
        self._rate = SmoothedRate()
        self._watch = StageWatch(clock)
        self._memory_before_mb = 0.0
        """Most that earlier runs of the same training held."""
        self._paused_stage: str | None = None
        self._report_cadence = Cadence(REPORT_EVERY_S)
        self._live_view = job.live_view
        self._snapshot_cadence = _snapshot_cadence(job.live_view)
        self._checkpoint_cadence = Cadence(CHECKPOINT_EVERY_S, CHECKPOINT_SHARE)
        self._held_out_cadence = Cadence(HELD_OUT_EVERY_S, HELD_OUT_SHARE)
        self._metrics_cadence = Cadence(METRICS_EVERY_S)
        self._is_snapshot_wanted = False
        self._snapshots = SnapshotWriter(Path(job.project) / "live", job.clip_index)
        self._snapshot_refusals = Refusals("The live view could not be written", send)
        self._checkpoint_refusals = Refusals("Progress could not be saved", send)
        self._curve_refusals = Refusals("The curves could not be written", send)
        self._folder: FolderWatch | None = None
        self._finished: CompactClip | None = None
        """Trained to the end, but not in its place yet."""
        self._retries = Retries(is_endless=job.is_window_open, clock=clock)

    # ---------------------------------------------------------------- the loop

    def advance(self) -> bool:
        """Prepare, or do some steps and what is due after them. False when the run has ended and said so."""
        try:
            try:
                return self._advance()
            except StopRequested:
                self._end_stopped(can_write=not self._is_in_step)
        except Exception as error:  # noqa: BLE001 - the edge of the worker loop: reported, never lost
            self._end_failed(error)
        return False

    def _advance(self) -> bool:
        if self._training is None:
            self._training = self._start()
            return True
        training = self._training
        self._obey()
        if self._is_paused:
            return True
        if training.is_finished:
            return self._finish(training)
        self._is_in_step, self._is_checkpointed_in_step = True, False
        self._watch.enter(TRAINING)
        started_s = self._clock()
        stats = training.step(self._n_at_once)
        self._is_in_step = False
        took_s = self._clock() - started_s
        if self._can_wait and took_s > 0.0:
            wanted = round(len(stats.gradient_norms) * REPORT_EVERY_S / took_s)
            self._n_at_once = min(max(wanted, 1), 2 * self._n_at_once)
        self._after_steps(training, stats)
        return True

    def _start(self) -> Training:
        job = self._job
        self._watch.enter(STARTING)
        self._folder = FolderWatch(Path(job.project))
        self._project = open_project(job.project, is_writable=False)
        checkpoint = self._project.checkpoint_path(job.clip_index)
        self._send(WorkerReady(pid=os.getpid(), n_threads=self._n_threads))
        training = self._make(job, self._report)
        is_restored = False
        if checkpoint.is_file():
            try:
                training.restore_checkpoint(checkpoint)
                is_restored = True
                self._take_up_curves()
                self._recall_times(training.steps_done)
                logger.info("clip %d resumes at step %d", job.clip_index, training.steps_done)
            except ProjectError as error:
                said = str(ProjectError(error.message, path=checkpoint))
                self._send(WarningRaised(f"Clip {job.clip_index} starts from the beginning", said))
                training = self._make(job, self._report)
        if not is_restored:
            self._project.discard_progress(job.clip_index)
            training.prepare()
        self._watch.enter(KEEPING)
        self._send(
            StepReported(
                step=training.steps_done,
                n_steps=training.n_steps,
                loss=math.nan,
                train_psnr=math.nan,
                n_gaussians=0,
                stage="",
                steps_per_s=0.0,
                gradient_norm=math.nan,
            )
        )
        self._measure(training)  # renders, so that every kernel is compiled before a window does the same
        if self._live_view != "off":
            self._write_snapshot(training)
        self._rate.update(training.steps_done, self._clock())
        return training

    def _after_steps(self, training: Training, stats: StepStats) -> None:
        self._watch.enter(KEEPING)
        now_s = self._clock()
        self._loss_sum += stats.loss * len(stats.gradient_norms)
        self._n_losses += len(stats.gradient_norms)
        self._gradient_norms += stats.gradient_norms
        self._n_clipped += stats.n_clipped
        is_last = training.is_finished
        if self._report_cadence.is_due(now_s) or is_last:
            self._report_cadence.done(now_s, now_s)
            self._check_folder()
            self._rate.update(stats.step, now_s)
            loss, gradient_norm = self._loss_sum / self._n_losses, max(self._gradient_norms[-self._n_losses :])
            self._loss_sum, self._n_losses = 0.0, 0
            self._send(
                StepReported(
                    step=stats.step,
                    n_steps=stats.n_steps,
                    loss=loss,
                    train_psnr=stats.train_psnr,
                    n_gaussians=stats.n_gaussians,
                    stage=stats.stage,
                    steps_per_s=self._rate.per_s,
                    gradient_norm=gradient_norm,
                )
            )
            if self._metrics_cadence.is_due(now_s) or is_last:
                self._metrics_cadence.done(now_s, now_s)
                row = {"step": stats.step, "loss": loss, "train_psnr": stats.train_psnr}
                self._note(row | {"gradient_norm": gradient_norm})
        is_wanted = self._is_snapshot_wanted or self._snapshot_cadence.is_due(now_s)
        if is_wanted and self._live_view != "off" and self._snapshots.is_free and not is_last:
            self._write_snapshot(training)
        if self._held_out_cadence.is_due(now_s) and not is_last:
            self._measure(training)
        if self._checkpoint_cadence.is_due(now_s) and not is_last:
            self._write_checkpoint(training)

    def _finish(self, training: Training) -> bool:
        """Put the finished clip in its place. Whether that has to be tried again."""
        self._check_folder()
        if self._retries.wait_s > 0:
            self._obey(self._retries.wait_s)
            return True
        self._watch.enter(KEEPING)
        try:
            if self._finished is None:
                self._finished = self._finished_clip(training)
            self._keep(self._finished, training)
        except DiskError as error:
            return self._try_again(training, error)
        return False

    def _try_again(self, training: Training, error: DiskError) -> bool:
        """The disk refused a finished clip: make room, or keep it as a checkpoint meanwhile. Whether to keep trying.

        Raises:
            DiskError: It is given up.
        """
        assert self._project is not None
        self._snapshots.clear()
        if remove_stages(self._project.prep_dir, self._job.clip_index):  # of no more use, and often what fills a disk
            return True
        is_first = self._retries.is_first
        is_kept = self._checkpoint_step() == training.steps_done or self._write_checkpoint(training)
        if not self._retries.failed(is_kept=is_kept):
            raise error
        if is_first:
            where = "It is saved as a checkpoint" if is_kept else "It is in memory only"
            title = f"Clip {self._job.clip_index} is trained, but could not be written"
            self._send(WarningRaised(title, f"{error} {where}, and writing will be tried again."))
            self._send(StageReported("Waiting for disk space", 1.0))
        return True

    def _finished_clip(self, training: Training) -> CompactClip:
        """The clip as it is stored, with its figures.

        Raises:
            DiskError: What other clips share could not be kept.
        """
        assert self._project is not None
        clip = training.finish()
        value = self._measure(training)
        norms, times = self._gradient_norms, self._watch.document()
        memory = self._memory()
        self._note({"step": training.steps_done, **times, **memory})
        figures = ClipFigures(
            held_out_psnr=value,
            gradient_norm_median=statistics.median(norms) if norms else None,
            gradient_norm_max=max(norms, default=None),
            gradient_clipped_steps=self._n_clipped if norms else None,
            **memory,
            **times,
        )
        return clip.with_figures(figures)

    def _keep(self, clip: CompactClip, training: Training) -> None:
        """Put the clip in its place, and what is not needed any more away.

        Raises:
            DiskError: The disk refused; everything is as it was.
        """
        assert self._project is not None
        project, clip_index = self._project, self._job.clip_index
        path = project.clip_path(clip_index)
        fingerprint = clip.state.header.fingerprint
        keep_clip(clip, path, project.live_dir, lambda: set_aside(project, clip_index, unless=fingerprint))
        forget_oldest(project, clip_index)
        try:
            self._project.keep_curves(self._job.clip_index)
        except OSError as error:
            logger.warning("the curves could not be stored (%s)", error.strerror)
        with suppress(OSError):
            self._project.checkpoint_path(self._job.clip_index).unlink(missing_ok=True)
        remove_stages(self._project.prep_dir, self._job.clip_index)
        self._snapshots.clear()
        logger.info("clip %d is trained: %d steps", self._job.clip_index, training.steps_done)
        if self._n_clipped:
            found = f"{self._n_clipped} of {len(self._gradient_norms)} steps, up to {max(self._gradient_norms):.3g}"
            logger.warning("clip %d: gradients were scaled down in %s", self._job.clip_index, found)
            title = f"Clip {self._job.clip_index} had gradients above max_gradient_norm"
            self._send(WarningRaised(title, f"They were scaled down in {found}."))
        self._send(ClipTrained(str(path), training.steps_done, clip.state.header.figures.held_out_psnr))

    # ---------------------------------------------------------------- commands

    def _obey(self, wait_s: float = 0.0) -> None:
        """Take every command that waits or comes within so many seconds; sit here while paused when that is allowed."""
        wait_s = min(wait_s, 1.0) if self._can_wait else 0.0
        while True:
            try:
                command = self._receive(wait_s)
            except Unwanted:  # the window is gone: keep progress and end
                self._stop = Stop(keep=True)
                raise StopRequested from None
            match command:
                case Stop():
                    self._stop = command
                    raise StopRequested
                case Pause() if not self._is_paused:
                    self._pause()
                case Resume() if self._is_paused:
                    self._is_paused = False
                    self._watch.enter(self._paused_stage)
                    self._send(TrainingResumed(self._steps_done))
                case SnapshotNow():
                    self._is_snapshot_wanted = True
                case SetSnapshots(mode=mode) if mode != self._live_view:
                    self._live_view = mode
                    self._snapshot_cadence = _snapshot_cadence(mode)
                    self._is_snapshot_wanted = mode == "live"
                case SnapshotConsumed(revision=revision):
                    self._snapshots.consumed(revision)
            if command is None and not (self._is_paused and self._can_wait):
                return
            wait_s = 1.0 if self._is_paused and self._can_wait else 0.0

    def _pause(self) -> None:
        self._is_paused = True
        self._rate.pause()
        if self._training is not None and not self._is_in_step:
            self._write_checkpoint(self._training)  # a pause may last over night
        self._paused_stage = self._watch.enter(None)
        self._send(TrainingPaused(self._steps_done))

    @property
    def _steps_done(self) -> int:
        return 0 if self._training is None else self._training.steps_done

    # ---------------------------------------------------------------- reporting and keeping

    def _report(self, progress: Progress) -> None:
        """Given to the training: passes progress on and obeys commands in between."""
        if self._is_in_step and not self._is_checkpointed_in_step and self._training is not None:
            # a step that reports is a change of phase: it takes long and is not done again for nothing
            self._is_checkpointed_in_step = True
            self._write_checkpoint(self._training)
        self._watch.reached(progress.stage, float(progress.done))
        now_s = self._clock()
        stage, message, reported_s = self._reported
        if (stage, message) != (progress.stage, progress.message) or now_s - reported_s >= REPORT_EVERY_S:
            if progress.message and message != progress.message:
                logger.info("%s: %s", progress.stage, progress.message)
            self._reported = (progress.stage, progress.message, now_s)
            self._check_folder()
            self._send(StageReported(progress.stage, float(progress.done), progress.message))
        self._obey()

    def _write_snapshot(self, training: Training) -> None:
        started_s = self._clock()
        self._is_snapshot_wanted = False
        try:
            self._send(self._snapshots.write(training.state()))
            self._snapshot_refusals.written()
        except ProjectError as error:  # a full disk must not end the training; the next snapshot may fit again
            self._snapshot_refusals.refused(error)
        self._snapshot_cadence.done(started_s, self._clock())

    def _write_checkpoint(self, training: Training) -> bool:
        assert self._project is not None
        self._check_folder()
        started_s = self._clock()
        is_written = True
        try:
            training.write_checkpoint(self._project.checkpoint_path(self._job.clip_index))
            self._checkpoint_refusals.written()
        except ProjectError as error:
            is_written = False
            self._checkpoint_refusals.refused(error)
        if is_written:  # beside the checkpoint, so that a run that continues from it knows what it took
            self._note({"step": training.steps_done, **self._watch.document(), **self._memory()})
        self._checkpoint_cadence.done(started_s, self._clock())
        return is_written

    def _checkpoint_step(self) -> int | None:
        """Steps that the checkpoint on disk holds."""
        assert self._project is not None
        header = read_clip_header(self._project.checkpoint_path(self._job.clip_index))
        return None if header is None else header.step

    def _check_folder(self) -> None:
        """Raises ProjectGone."""
        if self._folder is not None:
            self._folder.check()

    def _take_up_curves(self) -> None:
        """Curves of a training that an earlier version stopped lie where those of finished clips do now."""
        assert self._project is not None
        found = self._project.curve_path(self._job.clip_index, is_finished=False)
        with suppress(OSError):
            found.rename(self._project.unfinished_metrics_path(self._job.clip_index))

    def _recall_times(self, step: int) -> None:
        """Add what earlier runs took up to the checkpoint that this one continues from, and the most that they held."""
        assert self._project is not None
        rows = read_metrics(self._project.unfinished_metrics_path(self._job.clip_index))
        noted = [row for row in rows if row["step"] <= step and "stages_s" in row]
        for stage, seconds in (stages_of(noted[-1]) if noted else {}).items():
            self._watch.seconds[stage] = self._watch.seconds.get(stage, 0.0) + seconds
        self._memory_before_mb = max(map(memory_of, noted), default=0.0)

    def _memory(self) -> dict[str, float | None]:
        """memory_mb: most that this process held, or an earlier one of the same training; None where not known."""
        memory_mb = peak_mb()
        return {"memory_mb": None if memory_mb is None else max(memory_mb, self._memory_before_mb)}

    def _measure(self, training: Training) -> float | None:
        started_s = self._clock()
        value = float(training.held_out_psnr())
        self._held_out_cadence.done(started_s, self._clock())
        if not math.isfinite(value):
            return None
        self._send(HeldOutMeasured(training.steps_done, value))
        self._note({"step": training.steps_done, "held_out_psnr": value})
        return value

    def _note(self, row: dict[str, Any]) -> None:
        """Append one line to the metrics file, so that a restarted window has the whole curve."""
        assert self._project is not None
        path = self._project.unfinished_metrics_path(self._job.clip_index)
        row = {key: round(value, 6) if isinstance(value, float) else value for key, value in row.items()}
        try:
            path.parent.mkdir(exist_ok=True)  # not the project itself, which may be gone
            with open(open_to_append(path), "a", encoding="utf-8") as file:
                file.write(checked_line(row))
        except OSError as error:
            self._curve_refusals.refused(disk_error(error, what="A point of them", path=path))

    # ---------------------------------------------------------------- ends

    def _end_stopped(self, *, can_write: bool) -> None:
        assert self._project is not None
        checkpoint = self._project.checkpoint_path(self._job.clip_index)
        if self._stop is not None and not self._stop.keep:
            self._project.discard_progress(self._job.clip_index)
            remove_stages(self._project.prep_dir, self._job.clip_index)
        elif can_write and self._training is not None:
            self._checkpoint_refusals.written()  # said again if it is refused now
            self._write_checkpoint(self._training)
        self._snapshots.clear()
        self._send(TrainingStopped(str(checkpoint) if checkpoint.is_file() else "", self._steps_done))

    def _end_failed(self, error: Exception) -> None:
        trace = "".join(traceback.format_exception(error))
        logger.error("clip %d failed: %s", self._job.clip_index, trace)
        message, hint = str(error), ""
        if isinstance(error, EngineError):
            message, hint = error.parts()
        elif isinstance(error, MemoryError):
            message, hint = "There is not enough memory.", "Use a smaller scale or fewer points."
        else:
            message = f"{type(error).__name__}: {error}"
            hint = "This is a bug in the program; the log has the details."
        training = self._training
        is_whole = not self._is_in_step or isinstance(error, NonFiniteLoss)  # such a step has changed nothing
        has_learned = training is not None and (training.steps_done > 0 or isinstance(error, NonFiniteLoss))
        if training is not None and is_whole and has_learned and not isinstance(error, ProjectGone):
            message = f"{message} {self._keep_last_good(training)}"
        self._snapshots.clear()
        self._send(TrainingFailed(type(error).__name__, message, hint, trace))

    def _keep_last_good(self, training: Training) -> str:
        """Keep progress from before a failure, if it is any good. Says what is kept now."""
        try:
            is_good = is_finite(training.state())
        except EngineError:
            is_good = False
        step = training.steps_done
        if is_good and (self._checkpoint_step() == step or self._write_checkpoint(training)):
            return f"Step {step} is kept; training again with the same command resumes from there."
        kept = self._checkpoint_step()
        why = "could not be kept" if is_good else "holds numbers that are not finite"
        if kept is None:
            return f"Step {step} {why}; training again starts from the beginning."
        return f"Step {step} {why}; training again with the same command resumes from step {kept}."
