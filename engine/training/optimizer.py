"""Optimiser of a phase: Adam with one learning rate per kind of parameter, falling log-linearly to its end.

Rates carry no scene scale and the horizon is the phase's own number of steps, so every clip sees the whole schedule.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from engine.errors import NonFiniteLoss
from engine.model.clip_model import ClipModel
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
    """Adam over the trainable parameters of one phase. Owns moments and schedule, not the parameters."""

    def __init__(
        self,
        parameters: dict[str, tuple[nn.Parameter, float]],
        *,
        n_steps: int,
        config: TrainConfig,
    ) -> None:
        self._parameters = {name: parameter for name, (parameter, _) in parameters.items()}
        self._rates = {name: rate for name, (_, rate) in parameters.items()}
        self._final_ratio = config.final_lr_ratio
        self._max_norm = config.max_gradient_norm
        self.n_steps = n_steps
        self.steps_done = 0
        groups = [{"params": [p], "lr": self._rates[name], "name": name} for name, p in self._parameters.items()]
        # eps far below any gradient: rarely seen anchors must not be slowed down by it
        self._adam = torch.optim.Adam(groups, eps=1e-15, fused=True) if groups else None

    def step(self) -> None:
        """Apply the gradients and clear them.

        Raises:
            NonFiniteLoss: A gradient is not finite; parameters are left as they were.
        """
        if self._adam is None:
            return
        gradients = {name: p.grad for name, p in self._parameters.items() if p.grad is not None}
        norm = torch.nn.utils.get_total_norm(list(gradients.values()))
        if not torch.isfinite(norm):
            bad = [name for name, gradient in gradients.items() if not torch.isfinite(gradient).all()]
            raise NonFiniteLoss(f"The gradient of {', '.join(bad) or 'the sum'} is not finite.")
        if self._max_norm:
            torch.nn.utils.clip_grads_with_norm_(list(self._parameters.values()), self._max_norm, norm)
        decay = self._final_ratio ** (self.steps_done / max(self.n_steps, 1))
        for group in self._adam.param_groups:
            group["lr"] = self._rates[group["name"]] * decay
        self._adam.step()
        self._adam.zero_grad(set_to_none=True)
        self.steps_done += 1

    def arrays(self) -> dict[str, np.ndarray]:
        """Moments and step counts, for a checkpoint. Copies."""
        if self._adam is None:
            return {}
        return {
            f"optimizer.{name}.{key}": value.numpy().copy()
            for name, parameter in self._parameters.items()
            for key, value in self._adam.state[parameter].items()
        }

    def restore(self, arrays: dict[str, np.ndarray], steps_done: int) -> None:
        """Inverse of `arrays`."""
        self.steps_done = steps_done
        for name, parameter in self._parameters.items():
            prefix = f"optimizer.{name}."
            found = {
                k.removeprefix(prefix): torch.from_numpy(v.copy()) for k, v in arrays.items() if k.startswith(prefix)
            }
            if found and self._adam is not None:
                self._adam.state[parameter] = found
