"""Frozen Gaussians in front of learning ones, by a kernel that copies rows: see engine.model.joining."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from engine.backends.cpu.decode.rows import Copy, copy_rows
from engine.kernels.launch import launch
from engine.kernels.memory import RecycledMemory
from engine.raster.gaussians import Gaussians

MEMORY = RecycledMemory()
"""Idle memory of results."""


def join_cpu(frozen: Gaussians, rows: Tensor, learning: Gaussians) -> Gaussians:
    """Arguments are those of `join_frozen`, already checked; float32 on the cpu.

    Raises:
        TypeError: A column of either part is not float32 on the cpu, or rows or frozen columns are not contiguous.
    """
    for part, gaussians in (("frozen", frozen), ("learning", learning)):
        for column in gaussians.tensors():
            if column.dtype != torch.float32 or column.device.type != "cpu":
                raise TypeError(f"{part} must be float32 on the cpu, got {column.dtype} on {column.device}")
    if not rows.is_contiguous() or not all(column.is_contiguous() for column in frozen.tensors()):
        raise TypeError("rows and frozen must be contiguous; call contiguous() on their tensors")
    is_frozen = torch.ones(len(rows) + len(learning), dtype=torch.bool)
    is_frozen[len(rows) :] = learning.frozen_rows()
    return Gaussians(*_Join.apply(frozen, rows.numpy(), *learning.tensors()), is_frozen=is_frozen)  # pyright: ignore


class _Join(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, frozen: Gaussians, rows: np.ndarray, *columns: Tensor):
        ctx.n_frozen = len(rows)
        joined = []
        for source, column in zip(frozen.tensors(), columns, strict=True):
            target = MEMORY.empty(len(rows) + len(column), *column.shape[1:])
            row_bytes = 4 * (source.shape[1] if source.ndim == 2 else 1)
            launch(copy_rows, Copy(source, target, row_bytes, rows, len(rows), 0))
            # by numpy: torch's own threads would spin on the cores that the kernels need
            target.numpy()[len(rows) :] = column.detach().numpy()
            joined.append(target)
        return tuple(joined)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, *gradients: Tensor):  # pyright: ignore[reportIncompatibleMethodOverride]
        return None, None, *(gradient[ctx.n_frozen :] for gradient in gradients)
