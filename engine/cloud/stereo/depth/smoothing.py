"""Semi-global smoothing of matching costs and the choice of one inverse depth per pixel.

Source: Hirschmueller 2008, "Stereo processing by semiglobal matching"; eight paths. The jump penalty is unusually
strong because bare walls carry no evidence of their own.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

SMALL_STEP_PENALTY = 0.03
"""P1: neighbouring pixels one plane apart."""
JUMP_PENALTY = 5.0
"""P2: neighbouring pixels further apart, before the edge factor."""
EDGE_GREY_LEVELS = 8.0
"""P2 falls by e for this grey difference between the two pixels, never below 2 P1."""

_DIRECTIONS = ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (-1, -1), (1, -1), (-1, 1))  # (dy, dx)


def smooth_inverse_depth(costs: np.ndarray, grey: np.ndarray, inverse_depths: np.ndarray) -> np.ndarray:
    """The winning inverse depth per pixel after eight-path aggregation, refined between planes by a parabola.

    Args:
        costs: [H, W, D] float32
        grey: Guide picture, 0..255. [H, W] float32
        inverse_depths: Uniform planes. [D]
    Returns:
        float32 [H, W], within the range of inverse_depths.
    """
    height, width, n_planes = costs.shape
    totals = np.zeros_like(costs)
    paths = np.full((2, width, n_planes + 2), np.inf, np.float32)
    lowest = np.zeros((2, width), np.float32)
    for dy, dx in _DIRECTIONS:
        _add_path(costs, grey, dy, dx, paths, lowest, totals)
    chosen = np.empty((height, width), np.float32)
    _parabola_minimum(totals, inverse_depths.astype(np.float32), chosen)
    return chosen


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def _add_path(costs, grey, dy, dx, paths, lowest, totals):
    """Aggregate along one direction. Rows of `paths` carry a border of infinities so that d +- 1 needs no test."""
    height, width, n_planes = costs.shape
    small = np.float32(SMALL_STEP_PENALTY)
    is_forward = dy > 0 or (dy == 0 and dx > 0)
    for row in range(height):
        y = row if is_forward else height - 1 - row
        here = row & 1
        there = here if dy == 0 else 1 - here
        for column in range(width):
            x = column if is_forward else width - 1 - column
            px, py = x - dx, y - dy
            least = np.float32(np.inf)
            if px < 0 or px >= width or py < 0 or py >= height:
                for d in range(n_planes):
                    value = costs[y, x, d]
                    paths[here, x, d + 1] = value
                    totals[y, x, d] += value
                    least = min(least, value)
            else:
                jump = JUMP_PENALTY * math.exp(-abs(grey[y, x] - grey[py, px]) / EDGE_GREY_LEVELS)
                base = lowest[there, px]
                ceiling = base + np.float32(max(jump, 2.0 * SMALL_STEP_PENALTY))
                before = paths[there, px]
                now = paths[here, x]
                for d in range(n_planes):
                    step = min(before[d], before[d + 2]) + small
                    value = costs[y, x, d] + min(min(before[d + 1], step), ceiling) - base
                    now[d + 1] = value
                    totals[y, x, d] += value
                    least = min(least, value)
            lowest[here, x] = least


@njit(cache=True, nogil=True, error_model="numpy")
def _parabola_minimum(totals, inverse_depths, chosen):
    height, width, n_planes = totals.shape
    step = inverse_depths[1] - inverse_depths[0]
    for y in range(height):
        for x in range(width):
            best = 0
            for d in range(1, n_planes):
                if totals[y, x, d] < totals[y, x, best]:
                    best = d
            offset = 0.0
            if 0 < best < n_planes - 1:
                left, mid, right = totals[y, x, best - 1], totals[y, x, best], totals[y, x, best + 1]
                bend = left + right - 2.0 * mid
                if bend > 1e-9:
                    offset = min(max(0.5 * (left - right) / bend, -0.5), 0.5)
            chosen[y, x] = inverse_depths[best] + np.float32(offset) * step
