"""Error texts for a loss or gradient that is not finite: which part, at which step, and what to change."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from engine.errors import NonFiniteLoss
from engine.training.config import TrainConfig


def loss_not_finite(
    *, image: Tensor, photometric: float, volume: float, where: str, config: TrainConfig
) -> NonFiniteLoss:
    """The error for a loss that is not finite; names the term, and rendered values where they are the cause.

    Args:
        image: As rendered. [H, W, 3]
        photometric: Its part of the loss.
        volume: The volume term's part, 0 without one.
        where: Step and camera.
        config: Settings of the training, for the advice.
    """
    if not math.isfinite(photometric):
        n_bad = int((~torch.isfinite(image)).sum())
        cause = f"; {n_bad} of {image.numel()} rendered values are not finite" if n_bad else ""
        said = f"The photometric loss became {photometric} at {where}{cause}."
    elif not math.isfinite(volume):
        said = f"The volume term of the loss became {volume} at {where}; a Gaussian's scales are not finite."
    else:
        said = f"The loss overflowed at {where}: photometric {photometric:.3g}, volume {volume:.3g}."
    return NonFiniteLoss(said, hint=advice(config))


def gradient_not_finite(error: NonFiniteLoss, *, where: str, config: TrainConfig) -> NonFiniteLoss:
    """The optimiser's error, which names the parameters, with step and camera."""
    return NonFiniteLoss(f"{error.message.rstrip('.')} at {where}.", hint=advice(config))


def advice(config: TrainConfig) -> str:
    """What to change when it happens again. Settings of a project with progress stay, hence another folder."""
    clip = config.max_gradient_norm / 10 or 1.0
    return (
        f"If it happens again, train into another project folder with --set table_lr={config.table_lr / 2:g} "
        f"or --set max_gradient_norm={clip:g}."
    )
