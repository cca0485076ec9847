"""What the loop around a training needs of it: engine.training.ClipTraining has it, and the small ones of tests."""

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
    """What the loop needs of engine.training.ClipTraining; tests bring a small one."""

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
        """Build what the first step needs; may take a minute and report often."""
        ...

    def step(self, n: int = 1) -> StepStats:
        """So many optimiser steps, or fewer where a phase ends."""
        ...

    def state(self) -> ClipState:
        """A copy of the model."""
        ...

    def finish(self) -> CompactClip:
        """The model as it is stored; what is measured after that is what is stored. A checkpoint written later still
        holds what was trained. Raises DiskError, before anything has changed, where what other clips share cannot be
        kept."""
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
