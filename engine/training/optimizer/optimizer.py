"""Optimiser of a phase: Adam with one learning rate per kind of parameter, falling log-linearly to its end.

Of the rates only that of positions carries a scene scale. The horizon is the phase's own number of steps, so every clip
sees the whole schedule.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor, nn

from engine.backends.backend import Backend
from engine.errors import NonFiniteLoss
from engine.model.clip_model import ClipModel
from engine.model.host_array import host_array
from engine.training.config import TrainConfig

_HEADS = ("opacity", "color", "shape", "offset")


def named_parameters(
    model: ClipModel,
    gains: nn.Parameter,
    config: TrainConfig,
    corrections: nn.Parameter | None = None,
    *,
    extent: float = 1.0,
) -> dict[str, tuple[nn.Parameter, float]]:
    """Trainable parameters by name with their initial rate; frozen ones are left out altogether.

    Args:
        corrections: Of cameras.
        extent: Of the cameras, scene units: the unit of the rate of positions.
    """
    chosen: dict[str, tuple[nn.Parameter, float]] = {}

    def add(name: str, parameter: Tensor | None, rate: float) -> None:
        if isinstance(parameter, nn.Parameter) and parameter.requires_grad and parameter.numel():
            chosen[name] = (parameter, rate)

    for role in model.roles():
        anchors = model.anchor_set(role)
        add(f"sets.{role}.positions", anchors.positions, config.position_lr * extent)
        add(f"sets.{role}.features", anchors.features, config.feature_lr)
        add(f"sets.{role}.log_offset_scales", anchors.log_offset_scales, config.scale_lr)
        add(f"sets.{role}.log_base_scales", anchors.log_base_scales, config.scale_lr)
    for head in _HEADS:
        for i, parameter in enumerate(model.decoder.head_parameters(head)):
            add(f"decoder.{head}.{i}", parameter, getattr(config, f"{head}_head_lr"))
    if model.field is not None:
        for i, table in enumerate(model.field.tables):
            add(f"field.tables.{i}", table, config.table_lr)
        add("field.hidden", model.field.hidden.weight, config.field_mlp_lr)
        add("field.out", model.field.out.weight, config.field_mlp_lr)
    add("gains", gains, config.gain_lr)
    add("cameras", corrections, config.camera_lr)
    return chosen


class PhaseOptimizer:
    """Adam over the trainable parameters of one phase. Owns moments and schedule, not the parameters.

    Args:
        parameters: By name, with the rate at the start.
        n_steps: Steps of the phase, over which rates fall.
        config: Final ratio of the rates and the norm to clip at.
        final_ratios: Of parameters whose rates end elsewhere, by name.
        backend: What Adam is computed with.
    """

    def __init__(
        self,
        parameters: dict[str, tuple[nn.Parameter, float]],
        *,
        n_steps: int,
        config: TrainConfig,
        final_ratios: Mapping[str, float],
        backend: Backend,
    ) -> None:
        self._parameters = {name: parameter for name, (parameter, _) in parameters.items()}
        self._rates = {name: rate for name, (_, rate) in parameters.items()}
        self._final_ratios = dict.fromkeys(parameters, config.final_lr_ratio) | dict(final_ratios)
        self._max_norm = config.max_gradient_norm
        self.n_steps = n_steps
        self.steps_done = 0
        self._adam = backend.adam(self._parameters)

    def step(self) -> float:
        """Apply the gradients and clear them.

        Returns:
            Norm over all gradients before clipping.
        Raises:
            NonFiniteLoss: A gradient is not finite; parameters are left as they were.
        """
        gradients = {name: p.grad for name, p in self._parameters.items() if p.grad is not None}
        norm = self._adam.norm(gradients)
        if not math.isfinite(norm):
            bad = [name for name, gradient in gradients.items() if not torch.isfinite(gradient).all()]
            raise NonFiniteLoss(f"The gradient of {', '.join(bad) or 'the sum'} is not finite.")
        scale = self._max_norm / norm if self.clips(norm) else 1.0
        share_done = self.share_done
        rates = {name: rate * self._final_ratios[name] ** share_done for name, rate in self._rates.items()}
        self._adam.update(gradients, rates, scale)
        for parameter in self._parameters.values():
            parameter.grad = None
        self.steps_done += 1
        return norm

    @property
    def share_done(self) -> float:
        """How much of the fall of the rates lies behind, 0 to 1; rates are start * final_ratio ** this."""
        return self.steps_done / max(self.n_steps, 1)

    def clips(self, norm: float) -> bool:
        """Whether gradients of this norm are scaled down."""
        return 0.0 < self._max_norm < norm

    def arrays(self) -> dict[str, np.ndarray]:
        """Moments and step counts, for a checkpoint. Copies."""
        return {
            f"optimizer.{name}.{key}": host_array(value)
            for name, state in self._adam.state().items()
            for key, value in state.items()
        }

    def restore(self, arrays: dict[str, np.ndarray], steps_done: int) -> None:
        """Inverse of `arrays`."""
        self.steps_done = steps_done
        for name in self._parameters:
            prefix = f"optimizer.{name}."
            found = {
                k.removeprefix(prefix): torch.from_numpy(v.copy()) for k, v in arrays.items() if k.startswith(prefix)
            }
            if found:
                self._adam.restore(name, found)
