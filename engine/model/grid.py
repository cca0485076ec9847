"""Spatial hash grid of the field: corner indices, weights and the interpolation kernels.

Anchors do not move, so the eight corners of every level and their weights are constants of an anchor; they are
computed once (`corner_table`) and reused at every step. Time is not a grid axis: each frame of the clip is a knot with
tables of its own, so a picture touches the eight spatial corners of one knot only.

Letters: n rows, L levels, T entries per level, C channels. `encode` is the public op; `encode_reference` is the slow
truth it is checked against.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numba import njit, prange
from torch import Tensor

_PRIMES = (
    1,
    2654435761,
    805459861,
)  # the usual spatial hash primes (Teschner et al. 2003; Mueller et al. 2022)


@dataclass(frozen=True, slots=True)
class CornerTable:
    """Interpolation constants of fixed positions.

    Attributes:
        indices: Table entry of each corner. [A, L, 8] int32
        weights: Trilinear weight of each corner; each row sums to 1. [A, L, 8] float32
    """

    indices: np.ndarray
    weights: np.ndarray


def corner_table(unit_positions: np.ndarray, cells: tuple[int, ...], n_entries: int) -> CornerTable:
    """Corners and weights of positions in the unit cube.

    Args:
        unit_positions: Values outside 0..1 are clamped to the border. [A, 3]
        cells: Cells per axis of each level. L entries
        n_entries: Table entries per level, a power of two. A level is indexed densely when it fits, else hashed.
    Returns:
        CornerTable with indices in 0..n_entries-1.
    """
    clamped = np.clip(np.nan_to_num(unit_positions.astype(np.float64)), 0.0, 1.0)
    n_rows = len(clamped)
    indices = np.empty((n_rows, len(cells), 8), np.int32)
    weights = np.empty((n_rows, len(cells), 8), np.float32)
    for level, n_cells in enumerate(cells):
        scaled = clamped * n_cells
        corner = np.minimum(scaled.astype(np.int64), n_cells - 1)
        fraction = scaled - corner
        n_knots = n_cells + 1
        is_dense = n_knots**3 <= n_entries
        for bits in range(8):
            offset = np.array([bits & 1, bits >> 1 & 1, bits >> 2 & 1])
            knot = (corner + offset).astype(np.uint64)  # [A, 3]
            if is_dense:
                index = knot[:, 0] + np.uint64(n_knots) * (knot[:, 1] + np.uint64(n_knots) * knot[:, 2])
            else:
                mixed = knot[:, 0] * np.uint64(_PRIMES[0])
                mixed ^= knot[:, 1] * np.uint64(_PRIMES[1])
                mixed ^= knot[:, 2] * np.uint64(_PRIMES[2])
                index = mixed & np.uint64(n_entries - 1)
            indices[:, level, bits] = index.astype(np.int32)
            weights[:, level, bits] = np.where(offset, fraction, 1.0 - fraction).prod(axis=1)
    return CornerTable(indices, weights)


@njit(parallel=True, cache=True, nogil=True, error_model="numpy")
def _gather(rows, indices, weights, table, out):
    n_levels, n_channels = table.shape[0], table.shape[2]
    for i in prange(rows.shape[0]):
        row = rows[i]
        for level in range(n_levels):
            for channel in range(n_channels):
                out[i, level * n_channels + channel] = 0.0
            for corner in range(8):
                entry = indices[row, level, corner]
                weight = weights[row, level, corner]
                for channel in range(n_channels):
                    out[i, level * n_channels + channel] += weight * table[level, entry, channel]


@njit(parallel=True, cache=True, nogil=True, error_model="numpy")
def _scatter(rows, indices, weights, out_grad, table_grad):
    # Levels run in parallel: each owns its slice of the gradient, so no atomics and one fixed order of additions.
    n_levels, n_channels = table_grad.shape[0], table_grad.shape[2]
    for level in prange(n_levels):
        table_grad[level] = 0.0
        for i in range(rows.shape[0]):
            row = rows[i]
            for corner in range(8):
                entry = indices[row, level, corner]
                weight = weights[row, level, corner]
                for channel in range(n_channels):
                    table_grad[level, entry, channel] += weight * out_grad[i, level * n_channels + channel]


class _Encode(torch.autograd.Function):
    @staticmethod
    def forward(ctx, table: Tensor, rows: np.ndarray, corners: CornerTable) -> Tensor:
        out = torch.empty(len(rows), table.shape[0] * table.shape[2])
        _gather(rows, corners.indices, corners.weights, table.detach().numpy(), out.numpy())
        ctx.rows, ctx.corners, ctx.table_shape = rows, corners, table.shape
        return out

    @staticmethod
    def backward(ctx, *gradients: Tensor):
        (out_grad,) = gradients
        table_grad = torch.empty(ctx.table_shape)
        corners = ctx.corners
        _scatter(
            ctx.rows,
            corners.indices,
            corners.weights,
            out_grad.contiguous().numpy(),
            table_grad.numpy(),
        )
        return table_grad, None, None


def encode(table: Tensor, rows: np.ndarray, corners: CornerTable) -> Tensor:
    """Interpolate one knot's table at the chosen anchors.

    Args:
        table: [L, T, C] float32, contiguous.
        rows: Rows of the corner table. [n] int64
        corners: Constants of all anchors.
    Returns:
        [n, L * C], levels first. Differentiable in `table`. Checked against `encode_reference`.
    """
    return _Encode.apply(table, rows, corners)  # type: ignore[no-any-return]


def encode_reference(table: Tensor, rows: np.ndarray, corners: CornerTable) -> Tensor:
    """Slow truth of `encode`, any dtype, by torch indexing and autograd."""
    indices = torch.from_numpy(corners.indices[rows].astype(np.int64))  # [n, L, 8]
    weights = torch.from_numpy(corners.weights[rows]).to(table.dtype)
    levels = torch.arange(table.shape[0])[None, :, None]
    values = table[levels, indices]  # [n, L, 8, C]
    return (values * weights[..., None]).sum(2).flatten(1)
