"""Adam in plain torch, the operations of torch.optim.Adam: any device and floating dtype, and nothing read from it."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from engine.backends.backend import ADAM_BETAS, ADAM_EPSILON

BETA1, BETA2 = ADAM_BETAS


class ReferenceAdam:
    """See engine.backends.backend.Adam."""

    def __init__(self, parameters: Mapping[str, Tensor]) -> None:
        self._parameters = {name: parameter.detach() for name, parameter in parameters.items()}
        self.steps = dict.fromkeys(parameters, 0)
        self._means = {name: torch.zeros_like(value) for name, value in self._parameters.items()}
        self._squares = {name: torch.zeros_like(value) for name, value in self._parameters.items()}

    def step(
        self, gradients: Mapping[str, Tensor], rates: Mapping[str, float], *, max_norm: float, is_sound: Tensor
    ) -> Tensor:
        """See Adam."""
        norm = torch.nn.utils.get_total_norm(list(gradients.values()))
        is_sound = is_sound & norm.isfinite()
        scale = torch.where(norm > max_norm, max_norm / norm, 1.0) if max_norm > 0.0 else 1.0
        for name, gradient in gradients.items():
            self._update(name, gradient * scale, rates[name], is_sound)
        return norm

    def _update(self, name: str, gradient: Tensor, rate: float, is_sound: Tensor) -> None:
        self.steps[name] += 1
        value, mean, square = self._parameters[name], self._means[name], self._squares[name]
        new_mean = mean.lerp(gradient, 1 - BETA1)
        new_square = (square * BETA2).addcmul_(gradient, gradient, value=1 - BETA2)
        root_scale = (1 - BETA2 ** self.steps[name]) ** 0.5
        size = (new_square.sqrt() / root_scale).add_(ADAM_EPSILON)
        new_value = value.addcdiv(new_mean, size, value=-rate / (1 - BETA1 ** self.steps[name]))
        for kept, new in ((value, new_value), (mean, new_mean), (square, new_square)):
            torch.where(is_sound, new, kept, out=kept)

    def state(self) -> dict[str, dict[str, Tensor]]:
        """See Adam."""
        return {
            name: {
                "step": torch.tensor(n_steps, dtype=torch.float32),
                "exp_avg": self._means[name].clone(),
                "exp_avg_sq": self._squares[name].clone(),
            }
            for name, n_steps in self.steps.items()
            if n_steps
        }

    def restore(self, name: str, state: Mapping[str, Tensor]) -> None:
        """See Adam."""
        for moment, kept in (("exp_avg", self._means[name]), ("exp_avg_sq", self._squares[name])):
            if state[moment].shape != kept.shape:
                raise ValueError(f"{moment} of {name} is {list(state[moment].shape)}, not {list(kept.shape)}")
            kept.copy_(state[moment].detach())
        self.steps[name] = round(state["step"].item())  # a file gives a single number back as [1]
