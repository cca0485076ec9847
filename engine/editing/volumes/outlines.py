"""Which points a closed line goes around, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit


def in_outline(points: np.ndarray, outline: tuple[tuple[float, float], ...] | np.ndarray) -> np.ndarray:
    """Points [N, 2] that a closed polygon goes around. [N] bool"""
    corners = np.ascontiguousarray(outline, np.float64)
    return _in_outline(np.ascontiguousarray(points, np.float64), corners)


@njit(cache=True, nogil=True)
def _in_outline(points, corners):
    found = np.zeros(len(points), np.bool_)
    n = len(corners)
    for row in range(len(points)):
        x, y, winding = points[row, 0], points[row, 1], 0
        for i in range(n):
            j = i + 1 if i + 1 < n else 0
            x0, y0, x1, y1 = corners[i, 0], corners[i, 1], corners[j, 0], corners[j, 1]
            if (y0 <= y) == (y1 <= y):
                continue
            side = (x1 - x0) * (y - y0) - (x - x0) * (y1 - y0)
            if y1 > y0 and side > 0.0:
                winding += 1
            elif y1 < y0 and side < 0.0:
                winding -= 1
        found[row] = winding != 0
    return found
