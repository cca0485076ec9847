"""Frozen Gaussians in front of learning ones: one set for the rasterizer; gradients go to the learning part alone.

The frozen part is chosen Gaussian by Gaussian, finer than the anchors of `decode_anchors`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from engine.kernels.launch import launch
from engine.kernels.memory import RecycledMemory
from engine.model.decode.cpu.rows import Copy, copy_rows
from engine.raster.gaussians import Gaussians

MEMORY = RecycledMemory()
"""Idle memory of results."""


def join_frozen(frozen: Gaussians, rows: np.ndarray, learning: Gaussians) -> Gaussians:
    """Chosen rows of frozen Gaussians, then others; differentiable in the others alone. float32 on the cpu.

    Args:
        frozen: Contiguous.
        rows: Rows of `frozen`. [n] int64
        learning: Not frozen, or frozen in part.
    Raises:
        ValueError: A row is out of range.
        TypeError: Rows are not int64 in one piece, or a column of either part is not float32 on the cpu.
    """
    if rows.dtype != np.int64 or rows.ndim != 1 or not rows.flags.c_contiguous:
        raise TypeError(f"rows must be contiguous int64 [n], got {rows.dtype} {list(rows.shape)}")
    for part, gaussians in (("frozen", frozen), ("learning", learning)):
        for column in gaussians.tensors():
            if column.dtype != torch.float32 or column.device.type != "cpu":
                raise TypeError(f"{part} must be float32 on the cpu, got {column.dtype} on {column.device}")
    if not all(column.is_contiguous() for column in frozen.tensors()):
        raise TypeError("frozen must be contiguous; call contiguous() on its tensors")
    if len(rows) and not 0 <= rows.min() <= rows.max() < len(frozen):
        raise ValueError(f"rows must lie in 0..{len(frozen) - 1}, got {rows.min()}..{rows.max()}")
    is_frozen = torch.ones(len(rows) + len(learning), dtype=torch.bool)
    is_frozen[len(rows) :] = learning.frozen_rows()
    return Gaussians(*_Join.apply(frozen, rows, *learning.tensors()), is_frozen=is_frozen)  # pyright: ignore


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
