"""Optimiser of a phase: Adam with one learning rate per kind of parameter, falling log-linearly to its end.

Rates carry no scene scale and the horizon is the phase's own number of steps, so every clip sees the whole schedule.
"""

from __future__ import annotations

import math

import numpy as np
from torch import Tensor, nn

from engine.errors import NonFiniteLoss
from engine.model.clip_model import ClipModel
from engine.training.adam import make_adam, not_finite
from engine.training.config import TrainConfig

_HEAD_RATES = {
    "opacity": "opacity_head_lr",
    "color": "color_head_lr",
    "shape": "shape_head_lr",
    "offset": "offset_head_lr",
}


def named_parameters(
    model: ClipModel, gains: nn.Parameter, config: TrainConfig
) -> dict[str, tuple[nn.Parameter, float]]:
    """Trainable parameters by name with their initial rate; frozen ones are left out altogether."""
    chosen: dict[str, tuple[nn.Parameter, float]] = {}

    def add(name: str, parameter: Tensor, rate: float) -> None:
        if isinstance(parameter, nn.Parameter) and parameter.requires_grad and parameter.numel():
            chosen[name] = (parameter, rate)

    for role in model.roles():
        anchors = model.anchor_set(role)
        add(f"sets.{role}.features", anchors.features, config.feature_lr)
        add(f"sets.{role}.log_offset_scales", anchors.log_offset_scales, config.scale_lr)
        add(f"sets.{role}.log_base_scales", anchors.log_base_scales, config.scale_lr)
    for head, rate_name in _HEAD_RATES.items():
        for i, parameter in enumerate(model.decoder.head_parameters(head)):
            add(f"decoder.{head}.{i}", parameter, getattr(config, rate_name))
    if model.field is not None:
        for i, table in enumerate(model.field.tables):
            add(f"field.tables.{i}", table, config.table_lr)
        add("field.hidden", model.field.hidden.weight, config.field_mlp_lr)
        add("field.out", model.field.out.weight, config.field_mlp_lr)
    add("gains", gains, config.gain_lr)
    return chosen


class PhaseOptimizer:
    """Adam over the trainable parameters of one phase. Owns moments and schedule, not the parameters.

    Args:
        parameters: By name, with the rate at the start.
        n_steps: Steps of the phase, over which rates fall.
        config: Final ratio of the rates and the norm to clip at.
        backend: Of `engine.training.adam.make_adam`.
    """

    def __init__(
        self,
        parameters: dict[str, tuple[nn.Parameter, float]],
        *,
        n_steps: int,
        config: TrainConfig,
        backend: str = "auto",
    ) -> None:
        self._parameters = {name: parameter for name, (parameter, _) in parameters.items()}
        self._rates = {name: rate for name, (_, rate) in parameters.items()}
        self._final_ratio = config.final_lr_ratio
        self._max_norm = config.max_gradient_norm
        self.n_steps = n_steps
        self.steps_done = 0
        self._from_step, self._from_decay = 0, 1.0
        self._adam = make_adam(self._parameters, backend)

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
            bad = not_finite(gradients)
            raise NonFiniteLoss(f"The gradient of {', '.join(bad) or 'the sum'} is not finite.")
        scale = min(1.0, self._max_norm / (norm + 1e-6)) if self._max_norm else 1.0
        decay = self.decay
        self._adam.update(gradients, {name: rate * decay for name, rate in self._rates.items()}, scale)
        for parameter in self._parameters.values():
            parameter.grad = None
        self.steps_done += 1
        return norm

    @property
    def decay(self) -> float:
        """Share of the initial rates that the next step learns with."""
        share = (self.steps_done - self._from_step) / max(self.n_steps - self._from_step, 1)
        return self._from_decay * (self._final_ratio / self._from_decay) ** share

    def finish_within(self, n_steps: int) -> None:
        """From here on rates fall to their end within so many more steps, from where they are."""
        self._from_step, self._from_decay = self.steps_done, self.decay
        self.n_steps = self.steps_done + n_steps

    @property
    def schedule(self) -> list[float]:
        """Where the present fall of the rates began: step and share of the initial rates. For a checkpoint."""
        return [self._from_step, self._from_decay]

    @schedule.setter
    def schedule(self, values: list[float]) -> None:
        self._from_step, self._from_decay = int(values[0]), float(values[1])

    def arrays(self) -> dict[str, np.ndarray]:
        """Moments and step counts, for a checkpoint. Copies."""
        return {
            f"optimizer.{name}.{key}": value
            for name, state in self._adam.arrays().items()
            for key, value in state.items()
        }

    def restore(self, arrays: dict[str, np.ndarray], steps_done: int) -> None:
        """Inverse of `arrays`."""
        self.steps_done = steps_done
        for name in self._parameters:
            prefix = f"optimizer.{name}."
            found = {k.removeprefix(prefix): v for k, v in arrays.items() if k.startswith(prefix)}
            if found:
                self._adam.restore(name, found)
