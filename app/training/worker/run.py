"""TrainingRun: the loop around one clip's training, from the job to its end. Obeys commands, reports, and writes files
when due. It knows neither processes nor pipes: `worker` drives it in a process.
"""

from __future__ import annotations

import logging
import math
import os
import time
import traceback
from collections.abc import Callable

from app.project.claims.holder_record import machine_name
from app.training.messages import (
    ClipTrained,
    Command,
    Event,
    Pause,
    Resume,
    SetSnapshots,
    SnapshotConsumed,
    SnapshotNow,
    StageReported,
    Stop,
    TrainingFailed,
    TrainingPaused,
    TrainingResumed,
    TrainingStopped,
    TrainJob,
    WarningRaised,
    WorkerReady,
)
from app.training.store import ClipStore, OpenStore
from app.training.worker.cadence import Cadence
from app.training.worker.disk_retries import ProjectGone, Retries
from app.training.worker.failures import keep_last_good, words_of
from app.training.worker.interface import MakeTraining, Training
from app.training.worker.keeper import Keeper
from app.training.worker.stage_watch import KEEPING, STARTING, TRAINING, StageWatch
from app.training.worker.step_record import StepRecord, nothing_yet
from engine.children.kind import Unwanted
from engine.clip_files.clip_header import ClipFigures
from engine.clip_files.compact import CompactClip
from engine.errors import DiskError, NonFiniteLoss, ProjectError
from engine.progress import Progress, StepStats

logger = logging.getLogger(__name__)

REPORT_EVERY_S = 0.1
METRICS_EVERY_S = 0.5

Receive = Callable[[float], Command | None]
"""The next command, waiting at most this many seconds. Raises Unwanted once nobody is left to send one."""
Send = Callable[[Event], None]


class StopRequested(Exception):
    """Unwinds a preparation or a long step after Stop."""


class TrainingRun:
    """One clip, from the job to its end.

    Args:
        job: The training.
        open_store: Opens the store that it is read from and kept in.
        receive: Source of commands.
        send: Takes events.
        make_training: Builds the training; its report function stays valid for the whole run.
        can_wait: Whether to sit still while paused, as a process does, or to return at once.
        starting_s: What starting the process took before; part of the preparation.
        clock: Seconds; tests bring their own.
    """

    def __init__(
        self,
        job: TrainJob,
        open_store: OpenStore,
        *,
        receive: Receive,
        send: Send,
        make_training: MakeTraining,
        can_wait: bool = True,
        n_threads: int = 1,
        starting_s: float = 0.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._job, self._open_store, self._receive, self._send = job, open_store, receive, send
        self._make, self._can_wait, self._n_threads, self._clock = make_training, can_wait, n_threads, clock
        self._store: ClipStore | None = None
        self._training: Training | None = None
        self._is_paused = False
        self._stop: Stop | None = None
        self._is_in_step = False
        self._is_checkpointed_in_step = False
        self._reported: tuple[str, str, float] = ("", "", -math.inf)
        self._n_at_once = 1
        """Steps until numbers are read: about as many as go into REPORT_EVERY_S."""
        self._watch = StageWatch(clock, {STARTING: starting_s})
        self._record = StepRecord()
        self._keeper: Keeper | None = None
        self._paused_stage: str | None = None
        self._report_cadence = Cadence(REPORT_EVERY_S)
        self._metrics_cadence = Cadence(METRICS_EVERY_S)
        self._finished: CompactClip | None = None
        """Trained to the end, but not handed over yet."""
        self._retries = Retries(is_endless=job.is_window_open, clock=clock)

    @property
    def _kept(self) -> Keeper:
        assert self._keeper is not None
        return self._keeper

    @property
    def _steps_done(self) -> int:
        return 0 if self._training is None else self._training.steps_done

    # ---------------------------------------------------------------- the loop

    def advance(self) -> bool:
        """Prepare, or do some steps and the work due after them. False when the run has ended and reported it."""
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
        self._store = store = self._open_store()
        self._keeper = keeper = Keeper(job, store, send=self._send, watch=self._watch, clock=self._clock)
        self._send(WorkerReady(os.getpid(), self._n_threads, machine_name()))
        training = self._restored(store) or self._prepared(store)
        self._watch.enter(KEEPING)
        self._send(nothing_yet(training.steps_done, training.n_steps))
        keeper.measure(training)  # renders, so that every kernel is compiled before a window does the same
        keeper.write_snapshot(training)
        self._record.rate.update(training.steps_done, self._clock())
        return training

    def _prepared(self, store: ClipStore) -> Training:
        training = self._make(self._job, store, self._report)
        store.drop_progress(self._job.key)
        training.prepare()
        return training

    def _restored(self, store: ClipStore) -> Training | None:
        """The training as its checkpoint has it; None where there is none to continue from."""
        job, checkpoint = self._job, store.checkpoint(self._job.key)
        if checkpoint is None:
            return None
        training = self._make(job, store, self._report)
        try:
            training.restore_checkpoint(checkpoint)
        except ProjectError as error:
            said = str(ProjectError(error.message, path=checkpoint))
            self._send(WarningRaised(f"Clip {job.clip_index} starts from the beginning", said))
            return None
        self._kept.recall(training.steps_done)
        logger.info("clip %d resumes at step %d", job.clip_index, training.steps_done)
        return training

    def _after_steps(self, training: Training, stats: StepStats) -> None:
        self._watch.enter(KEEPING)
        now_s, is_last = self._clock(), training.is_finished
        self._record.add(stats)
        if self._report_cadence.is_due(now_s) or is_last:
            self._report_cadence.done(now_s, now_s)
            self._check_store()
            report = self._record.report(stats, now_s)
            self._send(report)
            if self._metrics_cadence.is_due(now_s) or is_last:
                self._metrics_cadence.done(now_s, now_s)
                row = {"step": report.step, "loss": report.loss, "train_psnr": report.train_psnr}
                self._kept.note(row | {"gradient_norm": report.gradient_norm})
        if not is_last:
            self._kept.keep_what_is_due(training)

    # ---------------------------------------------------------------- the finished clip

    def _finish(self, training: Training) -> bool:
        """Hand the finished clip over. Whether that has to be tried again."""
        assert self._store is not None
        self._check_store()
        if self._retries.wait_s > 0:
            self._obey(self._retries.wait_s)
            return True
        self._watch.enter(KEEPING)
        try:
            if self._finished is None:
                self._finished = self._finished_clip(training)
            self._store.put_clip(self._job.key, self._finished)
        except DiskError as error:
            return self._try_again(training, error)
        self._end_trained(self._finished, training)
        return False

    def _try_again(self, training: Training, error: DiskError) -> bool:
        """The disk refused a finished clip: make room, or keep it as a checkpoint meanwhile. Whether to keep trying.

        Raises:
            DiskError: It is given up.
        """
        assert self._store is not None
        self._kept.drop_snapshots()
        if self._store.drop_pieces(self._job.key):  # no longer of use, and often the files that fill a disk
            return True
        is_first = self._retries.is_first
        is_kept = self._kept.checkpoint_step == training.steps_done or self._kept.write_checkpoint(training)
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
            DiskError: Files that clips share could not be kept.
        """
        clip = training.finish()
        value = self._kept.measure(training)
        times, memory = self._watch.document(), self._kept.memory()
        self._kept.note({"step": training.steps_done, **times, **memory})
        return clip.with_figures(ClipFigures(held_out_psnr=value, **self._record.figures(), **memory, **times))

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
                    self._kept.want_snapshot()
                case SetSnapshots(mode=mode):
                    self._kept.set_live_view(mode)
                case SnapshotConsumed(revision=revision):
                    self._kept.consumed(revision)
            if command is None and not (self._is_paused and self._can_wait):
                return
            wait_s = 1.0 if self._is_paused and self._can_wait else 0.0

    def _pause(self) -> None:
        self._is_paused = True
        self._record.rate.pause()
        if self._training is not None and not self._is_in_step:
            self._kept.write_checkpoint(self._training)  # a pause may last over night
        self._paused_stage = self._watch.enter(None)
        self._send(TrainingPaused(self._steps_done))

    # ---------------------------------------------------------------- reports

    def _report(self, progress: Progress) -> None:
        """Given to the training: passes progress on and obeys commands in between."""
        if self._is_in_step and not self._is_checkpointed_in_step and self._training is not None:
            # a step that reports is a change of phase: it takes long and is not done again for nothing
            self._is_checkpointed_in_step = True
            self._kept.write_checkpoint(self._training)
        self._watch.reached(progress.stage, float(progress.done))
        now_s = self._clock()
        stage, message, reported_s = self._reported
        if (stage, message) != (progress.stage, progress.message) or now_s - reported_s >= REPORT_EVERY_S:
            if progress.message and message != progress.message:
                logger.info("%s: %s", progress.stage, progress.message)
            self._reported = (progress.stage, progress.message, now_s)
            self._check_store()
            self._send(StageReported(progress.stage, float(progress.done), progress.message))
        self._obey()

    def _check_store(self) -> None:
        """Raises ProjectGone."""
        if self._store is not None:
            self._store.check()

    # ---------------------------------------------------------------- ends

    def _end_trained(self, clip: CompactClip, training: Training) -> None:
        self._kept.drop_snapshots()
        logger.info("clip %d is trained: %d steps", self._job.clip_index, training.steps_done)
        if self._record.n_clipped:
            found = self._record.clipped_text
            logger.warning("clip %d: gradients were scaled down in %s", self._job.clip_index, found)
            title = f"Clip {self._job.clip_index} had gradients above max_gradient_norm"
            self._send(WarningRaised(title, f"They were scaled down in {found}."))
        self._send(ClipTrained(training.steps_done, clip.state.header.figures.held_out_psnr))

    def _end_stopped(self, *, can_write: bool) -> None:
        assert self._store is not None
        if self._stop is not None and not self._stop.keep:
            self._store.drop_progress(self._job.key)
            self._store.drop_pieces(self._job.key)
        elif can_write and self._training is not None:
            self._kept.write_last_checkpoint(self._training)
        self._kept.drop_snapshots()
        is_kept = self._store.checkpoint(self._job.key) is not None
        self._send(TrainingStopped(is_kept, self._steps_done))

    def _end_failed(self, error: Exception) -> None:
        trace = "".join(traceback.format_exception(error))
        logger.error("clip %d failed: %s", self._job.clip_index, trace)
        message, hint = words_of(error)
        training = self._training
        is_whole = not self._is_in_step or isinstance(error, NonFiniteLoss)  # such a step has changed nothing
        has_learned = training is not None and (training.steps_done > 0 or isinstance(error, NonFiniteLoss))
        if training is not None and is_whole and has_learned and not isinstance(error, ProjectGone):
            message = f"{message} {keep_last_good(training, self._kept)}"
        if self._keeper is not None:
            self._keeper.drop_snapshots()
        self._send(TrainingFailed(type(error).__name__, message, hint, trace))
