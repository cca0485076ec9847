"""Keeper: writes the files of a running training to its store, each as often as time allows: snapshots, checkpoints,
held-out figures and the rows of its curves. A disk that refuses costs these, never the training.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from app.background.memory import peak_mb
from app.project.clips.stage_seconds import memory_of, stages_of
from app.training.messages import Event, HeldOutMeasured, SnapshotWritten, TrainJob
from app.training.store import ClipStore
from app.training.worker.cadence import Cadence
from app.training.worker.disk_retries import Refusals
from app.training.worker.interface import Training
from app.training.worker.stage_watch import StageWatch
from engine.clip_files.clip_state import read_clip_header
from engine.errors import ProjectError

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
FEW_TRAININGS = 20
"""Up to so many at once they are that frequent; hundreds that share a disk, each with tens of megabytes, would wait for
it half of their time. Together they write no more than so many do."""


def _snapshot_cadence(live_view: str) -> Cadence:
    return Cadence(LOW_SNAPSHOT_EVERY_S if live_view == "low" else SNAPSHOT_EVERY_S, SNAPSHOT_SHARE)


class Keeper:
    """See the module docstring. At most one snapshot is unread at a time.

    Args:
        job, store: The training, and where it is kept.
        send: Takes events.
        watch: Knows how long each stage took.
        clock: Seconds.
    """

    def __init__(
        self,
        job: TrainJob,
        store: ClipStore,
        *,
        send: Callable[[Event], None],
        watch: StageWatch,
        clock: Callable[[], float],
    ) -> None:
        self._key, self._store, self._send, self._watch, self._clock = job.key, store, send, watch, clock
        self._live_view = job.live_view
        self._snapshot_cadence = _snapshot_cadence(job.live_view)
        self._checkpoint_cadence = Cadence(
            CHECKPOINT_EVERY_S * max(job.n_everywhere / FEW_TRAININGS, 1.0), CHECKPOINT_SHARE
        )
        self._held_out_cadence = Cadence(HELD_OUT_EVERY_S, HELD_OUT_SHARE)
        self._snapshot_refusals = Refusals("The live view could not be written", send)
        self._checkpoint_refusals = Refusals("Progress could not be saved", send)
        self._curve_refusals = Refusals("The curves could not be written", send)
        self._is_snapshot_wanted = False
        self._revision = self._consumed = 0
        self._snapshots: set[int] = set()
        self._memory_before_mb = 0.0
        """Peak memory of earlier runs of the same training."""

    def keep_what_is_due(self, training: Training) -> None:
        """After some steps, which were not the last."""
        now_s = self._clock()
        is_wanted = self._is_snapshot_wanted or self._snapshot_cadence.is_due(now_s)
        if is_wanted and self._consumed >= self._revision:
            self.write_snapshot(training)
        if self._held_out_cadence.is_due(now_s):
            self.measure(training)
        if self._checkpoint_cadence.is_due(now_s):
            self.write_checkpoint(training)

    # ---------------------------------------------------------------- snapshots

    def want_snapshot(self) -> None:
        """Write one at the next chance, for immediate viewing."""
        self._is_snapshot_wanted = True

    def set_live_view(self, mode: str) -> None:
        """How often snapshots are written from now on."""
        if mode != self._live_view:
            self._live_view, self._snapshot_cadence = mode, _snapshot_cadence(mode)
            self._is_snapshot_wanted = mode == "live"

    def write_snapshot(self, training: Training) -> None:
        """Write the next one, if any are wanted."""
        if self._live_view == "off":
            return
        started_s = self._clock()
        self._is_snapshot_wanted = False
        try:
            state, revision = training.state(), self._revision + 1
            self._store.put_snapshot(self._key, revision, state)
            self._revision = revision  # one that could not be written is not waited for
            self._snapshots.add(revision)
            self._send(SnapshotWritten(revision, state.header.step))
            self._snapshot_refusals.written()
        except ProjectError as error:  # a full disk must not end the training; the next snapshot may fit again
            self._snapshot_refusals.refused(error)
        self._snapshot_cadence.done(started_s, self._clock())

    def consumed(self, revision: int) -> None:
        """The reader is done with a snapshot: older ones go."""
        self._consumed = max(self._consumed, revision)
        self._drop({known for known in self._snapshots if known < self._consumed})

    def drop_snapshots(self) -> None:
        """The training has ended. A reader that comes late finds the finished clip instead."""
        self._drop(set(self._snapshots))

    def _drop(self, revisions: set[int]) -> None:
        self._snapshots -= revisions
        for revision in revisions:
            self._store.drop_snapshot(self._key, revision)

    # ---------------------------------------------------------------- checkpoints

    def write_checkpoint(self, training: Training) -> bool:
        """Keep everything that is needed to continue. Whether the disk took it."""
        self._store.check()
        started_s = self._clock()
        is_written = True
        try:
            self._store.put_checkpoint(self._key, training.write_checkpoint)
            self._checkpoint_refusals.written()
        except ProjectError as error:
            is_written = False
            self._checkpoint_refusals.refused(error)
        if is_written:  # next to the checkpoint, so that a run that continues from it knows its costs
            self.note({"step": training.steps_done, **self._watch.document(), **self.memory()})
        self._checkpoint_cadence.done(started_s, self._clock())
        return is_written

    def write_last_checkpoint(self, training: Training) -> None:
        """The same at the end, when a refusal is reported again."""
        self._checkpoint_refusals.written()
        self.write_checkpoint(training)

    @property
    def checkpoint_step(self) -> int | None:
        """Steps that the checkpoint holds; None without one."""
        path = self._store.checkpoint(self._key)
        header = None if path is None else read_clip_header(path)
        return None if header is None else header.step

    def recall(self, step: int) -> None:
        """Add the times of earlier runs up to the checkpoint that this one continues from, and their peak memory."""
        noted = [row for row in self._store.rows(self._key) if row["step"] <= step and "stages_s" in row]
        for stage, seconds in (stages_of(noted[-1]) if noted else {}).items():
            self._watch.seconds[stage] = self._watch.seconds.get(stage, 0.0) + seconds
        self._memory_before_mb = max(map(memory_of, noted), default=0.0)

    # ---------------------------------------------------------------- figures

    def memory(self) -> dict[str, float | None]:
        """memory_mb: Peak of this process, or an earlier one of the same training; None where not known."""
        memory_mb = peak_mb()
        return {"memory_mb": None if memory_mb is None else max(memory_mb, self._memory_before_mb)}

    def measure(self, training: Training) -> float | None:
        """PSNR of a few held-out pictures, dB; None where there are none."""
        started_s = self._clock()
        value = float(training.held_out_psnr())
        self._held_out_cadence.done(started_s, self._clock())
        if not math.isfinite(value):
            return None
        self._send(HeldOutMeasured(training.steps_done, value))
        row = {"step": training.steps_done, "training_s": self._watch.training_s, "held_out_psnr": value}
        self.note(row)
        return value

    def note(self, row: dict[str, Any]) -> None:
        """Append a row to the curves, so that a restarted window has all of them."""
        row = {key: round(value, 6) if isinstance(value, float) else value for key, value in row.items()}
        try:
            self._store.put_row(self._key, row)
        except ProjectError as error:
            self._curve_refusals.refused(error)
