"""Spatial hash grid of the field: corner indices, weights and the interpolation.

Anchors do not move, so the eight corners of every level and their weights are constants of an anchor; they are
computed once (`corner_table`) and reused at every step. Time is the fourth axis, with its knots exactly on the frames
of the clip, so a picture of a frame touches the eight spatial corners of one knot only. Either each knot has its own
tables, or all knots share one, as in the published 4D hash: the hash is the XOR of the coordinates' products, so the
entry at a knot is that of space XOR a key of that knot and level (`time_keys`), and the corners stay constants.

Letters: n rows, L levels, T entries per level, C channels. `encode` is plain torch.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from numba import njit
from torch import Tensor

_PRIMES = (1, 2654435761, 805459861, 3674653429)
"""The usual hash primes, of x, y, z and time (Teschner et al. 2003; Mueller et al. 2022)."""
_PRIMES_64 = np.array(_PRIMES, np.uint64)


@dataclass(frozen=True, slots=True)
class CornerTable:
    """Interpolation constants of fixed positions.

    Attributes:
        indices: Table entry of each corner. [A, L, 8] int32
        weights: Trilinear weight of each corner; each row sums to 1. [A, L, 8] float32
        n_entries: Table entries per level; indices are below it.
    """

    indices: Tensor
    weights: Tensor
    n_entries: int

    def to(self, device: torch.device) -> CornerTable:
        """The same on another device."""
        return replace(self, indices=self.indices.to(device), weights=self.weights.to(device))


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
    shape = len(clamped), len(cells), 8
    indices, weights = np.empty(shape, np.int32), np.empty(shape, np.float32)
    fill_corners(np.ascontiguousarray(clamped), np.array(cells, np.int64), n_entries, _PRIMES_64, indices, weights)
    return CornerTable(torch.from_numpy(indices), torch.from_numpy(weights), n_entries)


def corner_table_reference(unit_positions: np.ndarray, cells: tuple[int, ...], n_entries: int) -> CornerTable:
    """`corner_table` in plain numpy: the slow truth."""
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
    return CornerTable(torch.from_numpy(indices), torch.from_numpy(weights), n_entries)


def time_keys(cells: tuple[int, ...], n_entries: int, n_knots: int, strides: tuple[int, ...] = ()) -> Tensor:
    """The keys combined with the entries of each knot and level by XOR, where all knots share a table.

    Knots of a level that fits the table n_knots times lie side by side; otherwise they are spread by the hash.

    Args:
        cells: Cells per axis of each level. L entries
        n_entries: Table entries per level, a power of two.
        strides: Knots in a row that read the same entries, per level; one unless said.
    Returns:
        Keys below n_entries. [n_knots, L] int32
    """
    keys = np.empty((n_knots, len(cells)), np.int32)
    for level, (n_cells, stride) in enumerate(zip(cells, strides or (1,) * len(cells), strict=True)):
        knots = np.arange(n_knots, dtype=np.uint64) // np.uint64(stride)
        block = 1 << ((n_cells + 1) ** 3 - 1).bit_length()  # entries of one knot, rounded up to a power of two
        step = block if block * (int(knots[-1]) + 1) <= n_entries else _PRIMES[3]
        keys[:, level] = (knots * np.uint64(step) & np.uint64(n_entries - 1)).astype(np.int32)
    return torch.from_numpy(keys)


def encode(table: Tensor, rows: Tensor, corners: CornerTable, keys: Tensor | None = None) -> Tensor:
    """Interpolate one knot at the chosen anchors, by torch indexing: the slow truth, any dtype and device.

    Args:
        table: [L, T, C]
        rows: Rows of the corner table. [n] int64
        corners: Constants of all anchors.
        keys: Of this knot, from `time_keys`; None where it has its own table. [L] int32
    Returns:
        [n, L * C], levels first. Differentiable in `table`.
    """
    indices = corners.indices[rows]  # [n, L, 8]
    if keys is not None:
        indices = indices ^ keys[:, None]
    weights = corners.weights[rows].to(table.dtype)
    levels = torch.arange(table.shape[0], device=table.device)[None, :, None]
    values = table[levels, indices.long()]  # [n, L, 8, C]
    return (values * weights[..., None]).sum(2).flatten(1)


@njit(cache=True, nogil=True, error_model="numpy")
def fill_corners(unit_positions, cells, n_entries, primes, indices, weights):
    """Corners and weights of positions; written bit for bit as `corner_table_reference` gives them.

    Args:
        unit_positions: In 0..1, finite. [A, 3] float64
        cells: Cells per axis of each level. [L] int64
        n_entries: Table entries per level, a power of two.
        primes: Of the hash. [4] uint64
        indices: [A, L, 8] int32, written.
        weights: [A, L, 8] float32, written.
    """
    corner, fraction = np.empty(3, np.int64), np.empty(3)
    for row in range(len(unit_positions)):
        for level in range(len(cells)):
            n_cells = cells[level]
            for axis in range(3):
                scaled = unit_positions[row, axis] * n_cells
                corner[axis] = min(np.int64(scaled), n_cells - 1)
                fraction[axis] = scaled - corner[axis]
            n_knots = n_cells + 1
            is_dense = n_knots * n_knots * n_knots <= n_entries
            for bits in range(8):
                weight = 1.0
                x, y, z = corner[0] + (bits & 1), corner[1] + (bits >> 1 & 1), corner[2] + (bits >> 2 & 1)
                for axis in range(3):
                    weight *= fraction[axis] if bits >> axis & 1 else 1.0 - fraction[axis]
                if is_dense:
                    indices[row, level, bits] = x + n_knots * (y + n_knots * z)
                else:
                    mixed = np.uint64(x) * primes[0] ^ np.uint64(y) * primes[1] ^ np.uint64(z) * primes[2]
                    indices[row, level, bits] = np.int32(mixed & np.uint64(n_entries - 1))
                weights[row, level, bits] = weight
