"""Error texts for a loss or gradient that is not finite: which part, at which step, and what to change."""

from __future__ import annotations

import math

from engine.backends.phase import Fault
from engine.errors import NonFiniteLoss
from engine.training.config import TrainConfig


def not_finite(fault: Fault, *, where: str, config: TrainConfig) -> NonFiniteLoss:
    """The error for a step whose loss or gradient is not finite; names the term, and rendered values where they are the
    cause, or the parameters.

    Args:
        fault: The fault found.
        where: Step and camera.
        config: Settings of the training, for the advice.
    """
    photometric, volume = fault.photometric, fault.volume
    if not math.isfinite(photometric):
        cause = f"; {fault.n_bad} of {fault.n_values} rendered values are not finite" if fault.n_bad else ""
        said = f"The photometric loss became {photometric} at {where}{cause}."
    elif not math.isfinite(volume):
        said = f"The volume term of the loss became {volume} at {where}; a Gaussian's scales are not finite."
    elif fault.is_of_gradient:
        said = f"The gradient of {', '.join(fault.gradients) or 'the sum'} is not finite at {where}."
    else:
        said = f"The loss overflowed at {where}: photometric {photometric:.3g}, volume {volume:.3g}."
    return NonFiniteLoss(said, hint=advice(config))


def advice(config: TrainConfig) -> str:
    """The settings to change when the fault returns. Settings of a project with progress stay, hence another folder."""
    clip = config.max_gradient_norm / 10 or 1.0
    return (
        f"If it happens again, train into another project folder with --set table_lr={config.table_lr / 2:g} "
        f"or --set max_gradient_norm={clip:g}."
    )
