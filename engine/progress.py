"""The reports of a training while it runs: plain values, no tensors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a preparation stage is.

    Attributes:
        stage: Short name, as shown to the user.
        done: Share of the stage that is finished, 0..1.
        message: One line with counts and their reason; may be empty.
    """

    stage: str
    done: float
    message: str = ""


@dataclass(frozen=True, slots=True)
class StepStats:
    """Some optimiser steps.

    Attributes:
        step: Steps done, these included.
        n_steps: Steps of the whole clip.
        loss: Mean training loss of the pictures; with active tiles without the part that nothing can change.
        train_psnr: PSNR of the picture that was trained on last, dB.
        n_gaussians: Gaussians rendered last.
        stage: "static", "joint", "moving" or "source".
        gradient_norms: Of every step, over all gradients, before `max_gradient_norm` clips them.
        n_clipped: How many steps it clipped.
    """

    step: int
    n_steps: int
    loss: float
    train_psnr: float
    n_gaussians: int
    stage: str
    gradient_norms: tuple[float, ...]
    n_clipped: int = 0


ReportProgress = Callable[[Progress], None]
