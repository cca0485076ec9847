"""torch.optim.Adam behind the interface of a back end: any device and floating dtype."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from engine.backends.backend import ADAM_BETAS, ADAM_EPSILON


class ReferenceAdam:
    """See engine.backends.backend.Adam."""

    def __init__(self, parameters: Mapping[str, Tensor]) -> None:
        self._parameters = dict(parameters)
        groups = [{"params": [p], "name": name} for name, p in self._parameters.items()]
        nothing = {"params": [], "name": ""}  # torch wants a group even where nothing learns
        self._adam = torch.optim.Adam(groups or [nothing], betas=ADAM_BETAS, eps=ADAM_EPSILON)

    def norm(self, gradients: Mapping[str, Tensor]) -> float:
        """See Adam."""
        return float(torch.nn.utils.get_total_norm(list(gradients.values())))

    def update(self, gradients: Mapping[str, Tensor], rates: Mapping[str, float], scale: float) -> None:
        """See Adam."""
        for group in self._adam.param_groups:
            name = group["name"]
            if not name:
                continue
            group["lr"] = rates[name]
            gradient = gradients.get(name)
            group["params"][0].grad = None if gradient is None else gradient * scale
        self._adam.step()

    def state(self) -> dict[str, dict[str, Tensor]]:
        """See Adam."""
        states = {name: self._adam.state[parameter] for name, parameter in self._parameters.items()}
        return {name: {k: v.clone() for k, v in state.items()} for name, state in states.items() if state}

    def restore(self, name: str, state: Mapping[str, Tensor]) -> None:
        """See Adam."""
        parameter = self._parameters[name]
        restored = {"step": state["step"].detach().float().cpu().reshape(())}  # a file gives a number back as [1]
        for moment in ("exp_avg", "exp_avg_sq"):
            if state[moment].shape != parameter.shape:
                raise ValueError(f"{moment} of {name} is {list(state[moment].shape)}, not {list(parameter.shape)}")
            restored[moment] = state[moment].to(parameter, copy=True)
        self._adam.state[parameter] = restored
