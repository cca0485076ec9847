"""Optimiser of a phase: Adam with one learning rate per kind of parameter, falling log-linearly to its end.

Of the rates only those of positions and of motion carry a scene scale. The horizon is the phase's own number of steps,
so every clip sees the whole schedule.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor, nn

from engine.backends.backend import Backend
from engine.backends.phase import Schedule
from engine.model.clip_model import ClipModel
from engine.model.host_array import host_array
from engine.training.config import TrainConfig

_VELOCITY_LR, _ACCELERATION_LR = 2e-3, 2e-4
"""Rates of motion, anchor spacings a frame, and a frame squared: either moves an anchor by about a hundredth of a
spacing a step, five frames from its birth. Five times as much is worse."""
_TRAVELLING_LR = 2.0
"""Anchors that travel learn their features so many times as fast: what they are on looks alike in all their frames."""
_HEADS = ("opacity", "color", "shape", "offset")
Mark = tuple[int, dict[str, int]]
"""Counts of steps: of the phase, and of every parameter."""


def named_parameters(
    model: ClipModel,
    gains: nn.Parameter,
    config: TrainConfig,
    corrections: nn.Parameter | None = None,
    *,
    extent: float = 1.0,
    spacing: float = 1.0,
) -> dict[str, tuple[nn.Parameter, float]]:
    """Trainable parameters by name with their initial rate; frozen ones are left out altogether.

    Args:
        corrections: Of cameras.
        extent: Of the cameras, scene units: the unit of the rate of positions.
        spacing: Between anchors that move, scene units: the unit of the rates of their motion.
    """
    chosen: dict[str, tuple[nn.Parameter, float]] = {}

    def add(name: str, parameter: Tensor | None, rate: float) -> None:
        if isinstance(parameter, nn.Parameter) and parameter.requires_grad and parameter.numel():
            chosen[name] = (parameter, rate)

    for role in model.roles():
        anchors = model.anchor_set(role)
        add(f"sets.{role}.positions", anchors.positions, config.position_lr * extent)
        if anchors.travels:
            add(f"sets.{role}.velocities", anchors.velocities, _VELOCITY_LR * spacing)
            add(f"sets.{role}.accelerations", anchors.accelerations, _ACCELERATION_LR * spacing)
        faster = _TRAVELLING_LR if anchors.travels else 1.0
        add(f"sets.{role}.features", anchors.features, config.feature_lr * faster)
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


def schedule_of(
    parameters: Mapping[str, tuple[nn.Parameter, float]],
    config: TrainConfig,
    *,
    n_steps: int,
    final_ratios: Mapping[str, float] | None = None,
    is_over: bool = False,
) -> Schedule:
    """How fast they learn.

    Args:
        parameters: By name, with the rate at the start.
        config: Final ratio of the rates and the norm to clip at.
        n_steps: Steps of the phase, over which rates fall.
        final_ratios: Of parameters whose rates end elsewhere, by name.
        is_over: Whether the rates have fallen before, and stay at their ends.
    """
    rates = {name: rate for name, (_, rate) in parameters.items()}
    ratios = dict.fromkeys(parameters, config.final_lr_ratio) | dict(final_ratios or {})
    if is_over:
        rates, ratios = {name: rate * ratios[name] for name, rate in rates.items()}, dict.fromkeys(ratios, 1.0)
    return Schedule(n_steps, rates, ratios, config.max_gradient_norm)


class PhaseOptimizer:
    """Adam over the trainable parameters of one phase. Owns moments, not the parameters.

    Args:
        parameters: By name.
        schedule: How fast they learn.
        backend: The backend Adam is computed with.
    """

    def __init__(self, parameters: Mapping[str, nn.Parameter], *, schedule: Schedule, backend: Backend) -> None:
        self._parameters, self._schedule = dict(parameters), schedule
        self._is_sound = torch.ones((), dtype=torch.bool, device=backend.device)
        self.steps_done = 0
        self._adam = backend.adam(self._parameters)

    def step(self, is_sound: Tensor | None = None) -> Tensor:
        """Apply the gradients and clear them. It counts, but changes no value, where a gradient is not finite.

        Args:
            is_sound: Scalar bool; where it is false nothing changes either.
        Returns:
            Norm over all gradients before clipping. Scalar
        """
        gradients = {name: p.grad for name, p in self._parameters.items() if p.grad is not None}
        done, ratios = self.steps_done / max(self._schedule.n_steps, 1), self._schedule.final_ratios
        rates = {name: rate * ratios[name] ** done for name, rate in self._schedule.rates.items()}
        is_sound = self._is_sound if is_sound is None else is_sound
        norm = self._adam.step(gradients, rates, max_norm=self._schedule.max_gradient_norm, is_sound=is_sound)
        self.clear()
        self.steps_done += 1
        return norm

    def clear(self) -> None:
        """Forget the gradients."""
        for parameter in self._parameters.values():
            parameter.grad = None

    def not_finite(self) -> tuple[str, ...]:
        """Names of the parameters whose gradient is not finite."""
        gradients = ((name, p.grad) for name, p in self._parameters.items())
        return tuple(name for name, grad in gradients if grad is not None and not torch.isfinite(grad).all())

    def mark(self) -> Mark:
        """The state to return to if the steps from here on change nothing."""
        return self.steps_done, dict(self._adam.steps)

    def go_back(self, mark: Mark) -> None:
        """Undo the count of steps that changed nothing."""
        self.steps_done, self._adam.steps = mark[0], dict(mark[1])

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
