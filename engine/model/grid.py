"""Spatial hash grid of the field: corner indices, weights and the interpolation.

Anchors do not move, so the eight corners of every level and their weights are constants of an anchor; they are
computed once (`corner_table`) and reused at every step. Time is not a grid axis: each frame of the clip is a knot with
tables of its own, so a picture touches the eight spatial corners of one knot only.

Letters: n rows, L levels, T entries per level, C channels. `encode` is plain torch; the fused decode has it as a kernel
(engine.model.cpu.grid_kernels).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
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
        n_entries: Table entries per level; indices are below it.
    """

    indices: np.ndarray
    weights: np.ndarray
    n_entries: int


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
    return CornerTable(indices, weights, n_entries)


def encode(table: Tensor, rows: Tensor, corners: CornerTable) -> Tensor:
    """Interpolate one knot's table at the chosen anchors, by torch indexing: the slow truth, any dtype.

    Args:
        table: [L, T, C]
        rows: Rows of the corner table. [n] int64
        corners: Constants of all anchors.
    Returns:
        [n, L * C], levels first. Differentiable in `table`.
    """
    indices = torch.from_numpy(corners.indices[rows.numpy()].astype(np.int64))  # [n, L, 8]
    weights = torch.from_numpy(corners.weights[rows.numpy()]).to(table.dtype)
    levels = torch.arange(table.shape[0])[None, :, None]
    values = table[levels, indices]  # [n, L, 8, C]
    return (values * weights[..., None]).sum(2).flatten(1)
