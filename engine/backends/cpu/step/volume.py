"""Volume term of the loss: keeps Gaussians from growing where nothing else holds them."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor


def volume_sum_cpu(scales: Tensor, unit: float) -> Tensor:
    """Sum of the products of three scales, in cubes of `unit`; differentiable in float32 on the cpu.

    One pass of numpy: torch would wake its threads a dozen times for a few thousand Gaussians.

    Args:
        scales: [N, 3]
        unit: Scene units.
    """
    total = _VolumeSum.apply(scales, unit)
    assert isinstance(total, Tensor)
    return total


class _VolumeSum(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, scales: Tensor, unit: float):
        x, y, z = scales.detach().numpy().T / np.float32(unit)
        ctx.unit, ctx.sides = unit, (x, y, z)
        return torch.tensor((x * y * z).sum(dtype=np.float64), dtype=torch.float32)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, *gradients: Tensor):  # pyright: ignore[reportIncompatibleMethodOverride]
        x, y, z = ctx.sides
        slope = np.float32(float(gradients[0]) / ctx.unit)
        found = np.empty((len(x), 3), np.float32)
        for column, others in enumerate((y * z, x * z, x * y)):
            np.multiply(others, slope, out=found[:, column])
        return torch.from_numpy(found), None
