"""The kernel of `engine.model.grid.corner_table`: anchors whose positions learn need it at every step."""

from __future__ import annotations

import numpy as np
from numba import njit


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
