"""What a training tells the outside while it runs: plain values, no tensors."""

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
    """One optimiser step.

    Attributes:
        step: Steps done, this one included.
        n_steps: Steps of the whole clip.
        loss: Training loss of the picture; with active tiles without the part that nothing can change.
        train_psnr: PSNR of the picture that was trained on, dB.
        n_gaussians: Gaussians rendered.
        stage: "static", "joint" or "source".
        gradient_norm: Euclidean norm over all gradients, before `max_gradient_norm` clips it.
        is_clipped: Whether it did.
    """

    step: int
    n_steps: int
    loss: float
    train_psnr: float
    n_gaussians: int
    stage: str
    gradient_norm: float
    is_clipped: bool = False


ReportProgress = Callable[[Progress], None]
