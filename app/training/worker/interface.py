"""The interface of a training to the loop around it, as of engine.training.ClipTraining and the small ones of tests."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from app.training.messages import TrainJob
from app.training.store import ClipStore
from engine.clip_files.clip_state import ClipState
from engine.clip_files.compact import CompactClip
from engine.progress import ReportProgress, StepStats


class Training(Protocol):
    """The part of engine.training.ClipTraining that the loop uses; tests bring a small one."""

    @property
    def n_steps(self) -> int:
        """Steps of the whole clip."""
        ...

    @property
    def steps_done(self) -> int:
        """Steps done."""
        ...

    @property
    def is_finished(self) -> bool:
        """Whether every step was done."""
        ...

    def prepare(self) -> None:
        """Build the inputs of the first step; may take a minute and report often."""
        ...

    def step(self, n: int = 1) -> StepStats:
        """So many optimiser steps, or fewer where a phase ends."""
        ...

    def state(self) -> ClipState:
        """A copy of the model."""
        ...

    def finish(self) -> CompactClip:
        """The model as it is stored; later measurements are of that. A checkpoint written later still holds the model
        as trained. Raises DiskError, before anything has changed, where files that clips share cannot be kept."""
        ...

    def write_checkpoint(self, path: Path | str) -> None:
        """Everything needed to continue."""
        ...

    def restore_checkpoint(self, path: Path | str) -> None:
        """Instead of prepare."""
        ...

    def held_out_psnr(self) -> float:
        """dB; NaN without held-out cameras."""
        ...


MakeTraining = Callable[[TrainJob, ClipStore, ReportProgress], Training]
