"""Depth order: a stable radix sort of positive floats."""

from __future__ import annotations

import numpy as np
from numba import njit

from engine.backends.cpu.raster import record as rec

_BITS = 11
_DIGITS = 1 << _BITS
_MASK = np.uint32(_DIGITS - 1)
_SHIFT_1, _SHIFT_2 = np.uint32(_BITS), np.uint32(2 * _BITS)
_ZERO = np.float32(0.0)


@njit(**rec.KERNEL_OPTIONS)
def sort_by_depth(depths, n_rows, key_a, key_b, order, order_b):
    """Rows with depths[row] > 0, nearest first, equal depths in row order.

    Positive floats compare like their bit patterns, so three passes over 11-bit digits sort them. Three passes end in
    the first pair of buffers.

    Args:
        depths: float32, at least n_rows.
        key_a, key_b, order_b: uint32 scratch of n_rows.
        order: uint32 of n_rows, the result.
    Returns:
        How many rows there are.
    """
    bits = depths.view(np.uint32)
    starts = np.zeros((3, _DIGITS), np.uint32)
    n_kept = 0
    for row in range(n_rows):
        if depths[row] > _ZERO:
            key = bits[row]
            key_b[n_kept] = key
            order_b[n_kept] = row
            n_kept += 1
            starts[0, key & _MASK] += np.uint32(1)
            starts[1, (key >> _SHIFT_1) & _MASK] += np.uint32(1)
            starts[2, key >> _SHIFT_2] += np.uint32(1)
    for digit_pass in range(3):
        total = np.uint32(0)
        for digit in range(_DIGITS):
            count = starts[digit_pass, digit]
            starts[digit_pass, digit] = total
            total += count
    for i in range(n_kept):
        key = key_b[i]
        place = starts[0, key & _MASK]
        starts[0, key & _MASK] = place + np.uint32(1)
        key_a[place] = key
        order[place] = order_b[i]
    for i in range(n_kept):
        key = key_a[i]
        digit = (key >> _SHIFT_1) & _MASK
        place = starts[1, digit]
        starts[1, digit] = place + np.uint32(1)
        key_b[place] = key
        order_b[place] = order[i]
    for i in range(n_kept):
        digit = key_b[i] >> _SHIFT_2
        place = starts[2, digit]
        starts[2, digit] = place + np.uint32(1)
        order[place] = order_b[i]
    return n_kept
