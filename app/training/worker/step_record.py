"""StepRecord: a run's figures of its steps: losses and gradients since the last report, and of all of them."""

from __future__ import annotations

import math
import statistics
from typing import Any

from app.training.messages import StepReported
from app.training.rate import SmoothedRate
from engine.progress import StepStats


class StepRecord:
    """Numbers of the steps of this process.

    Attributes:
        rate: Steps per second.
        n_clipped: Steps whose gradients were scaled down.
    """

    def __init__(self) -> None:
        self.rate = SmoothedRate()
        self.n_clipped = 0
        self._loss_sum, self._n_losses = 0.0, 0
        """Losses of the steps since the last report."""
        self._norms: list[float] = []
        """Norms of the gradients of all steps."""

    def add(self, stats: StepStats) -> None:
        """Record that some steps were done."""
        self._loss_sum += stats.loss * len(stats.gradient_norms)
        self._n_losses += len(stats.gradient_norms)
        self._norms += stats.gradient_norms
        self.n_clipped += stats.n_clipped

    def report(self, stats: StepStats, now_s: float) -> StepReported:
        """The report of the steps since the last one, which end with these."""
        self.rate.update(stats.step, now_s)
        loss, gradient_norm = self._loss_sum / self._n_losses, max(self._norms[-self._n_losses :])
        self._loss_sum, self._n_losses = 0.0, 0
        return StepReported(
            step=stats.step,
            n_steps=stats.n_steps,
            loss=loss,
            train_psnr=stats.train_psnr,
            n_gaussians=stats.n_gaussians,
            stage=stats.stage,
            steps_per_s=self.rate.per_s,
            gradient_norm=gradient_norm,
        )

    def figures(self) -> dict[str, Any]:
        """Figures of the gradients that a clip stores."""
        norms = self._norms
        return {
            "gradient_norm_median": statistics.median(norms) if norms else None,
            "gradient_norm_max": max(norms, default=None),
            "gradient_clipped_steps": self.n_clipped if norms else None,
        }

    @property
    def clipped_text(self) -> str:
        """How many gradients were scaled down, and how large they were."""
        return f"{self.n_clipped} of {len(self._norms)} steps, up to {max(self._norms):.3g}"


def nothing_yet(step: int, n_steps: int) -> StepReported:
    """The report before the first step of a process."""
    return StepReported(
        step=step,
        n_steps=n_steps,
        loss=math.nan,
        train_psnr=math.nan,
        n_gaussians=0,
        stage="",
        steps_per_s=0.0,
        gradient_norm=math.nan,
    )
