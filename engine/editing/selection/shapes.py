"""Shapes that are drawn over a picture, as masks of its pixels: a pixel belongs to a shape if its centre does."""

from __future__ import annotations

import numpy as np
from numba import njit

MAX_POINTS = 20_000
"""Of a lasso or a stroke; a hand draws fewer. Of more, evenly chosen ones count."""


def rectangle_mask(x0: float, y0: float, x1: float, y1: float, size: tuple[int, int]) -> np.ndarray:
    """Pixels in the rectangle between two corners, in any order; its border belongs to it.

    Args:
        size: Width and height of the picture, px.
    Returns:
        [H, W] bool; nothing where a number is not finite.
    """
    width, height = size
    mask = np.zeros((height, width), np.bool_)
    if np.isfinite([x0, y0, x1, y1]).all():
        xs, ys = np.arange(width) + 0.5, np.arange(height) + 0.5
        is_column = (xs >= min(x0, x1)) & (xs <= max(x0, x1))
        is_row = (ys >= min(y0, y1)) & (ys <= max(y0, y1))
        mask[np.ix_(is_row, is_column)] = True
    return mask


def lasso_mask(points: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Pixels that a closed polygon goes around, however it crosses itself: what it goes around twice is inside.

    Args:
        points: Corners, the last one joined to the first, px. [P, 2]
        size: Width and height of the picture, px.
    Returns:
        [H, W] bool; nothing for fewer than three points.
    """
    mask = np.zeros((size[1], size[0]), np.bool_)
    corners = _usable(points)
    if len(corners) >= 3:
        _fill(corners, mask)
    return mask


def brush_mask(points: np.ndarray, radius_px: float, size: tuple[int, int]) -> np.ndarray:
    """Pixels under a disc that is moved along a line.

    Args:
        points: Of the line; a single one is a dab. px [P, 2]
        radius_px: Of the disc.
        size: Width and height of the picture, px.
    Returns:
        [H, W] bool
    """
    mask = np.zeros((size[1], size[0]), np.bool_)
    line = _usable(points)
    if len(line) and np.isfinite(radius_px) and radius_px > 0.0:
        _stroke(line, float(radius_px), mask)
    return mask


def _usable(points: np.ndarray) -> np.ndarray:
    """The points that are finite, held where a number of pixels still is one, and not too many. [P, 2] float64"""
    array = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    array = np.clip(array[np.isfinite(array).all(axis=1)], -1e7, 1e7)
    if len(array) > MAX_POINTS:
        array = array[np.linspace(0, len(array) - 1, MAX_POINTS).round().astype(np.int64)]
    return np.ascontiguousarray(array)


@njit(cache=True, nogil=True, error_model="numpy")
def _fill(corners, mask):
    height, width = mask.shape
    n = len(corners)
    crossings, turns = np.empty(n), np.empty(n, np.int64)
    for row in range(height):
        y = row + 0.5
        n_crossings = 0
        for i in range(n):
            j = i + 1 if i + 1 < n else 0
            y0, y1 = corners[i, 1], corners[j, 1]
            if (y0 <= y) == (y1 <= y):
                continue
            crossings[n_crossings] = corners[i, 0] + (y - y0) / (y1 - y0) * (corners[j, 0] - corners[i, 0])
            turns[n_crossings] = 1 if y1 > y0 else -1
            n_crossings += 1
        if n_crossings == 0:
            continue
        order = np.argsort(crossings[:n_crossings])
        winding = 0
        for k in range(n_crossings - 1):
            winding += turns[order[k]]
            if winding == 0:
                continue
            first = max(int(np.ceil(crossings[order[k]] - 0.5)), 0)
            stop = min(int(np.ceil(crossings[order[k + 1]] - 0.5)), width)
            for column in range(first, stop):
                mask[row, column] = True


@njit(cache=True, nogil=True, error_model="numpy")
def _stroke(line, radius, mask):
    height, width = mask.shape
    for i in range(max(len(line) - 1, 1)):
        j = min(i + 1, len(line) - 1)
        ax, ay, bx, by = line[i, 0], line[i, 1], line[j, 0], line[j, 1]
        dx, dy = bx - ax, by - ay
        length_squared = dx * dx + dy * dy
        first_x, last_x = max(int(np.floor(min(ax, bx) - radius)), 0), min(int(max(ax, bx) + radius), width - 1)
        first_y, last_y = max(int(np.floor(min(ay, by) - radius)), 0), min(int(max(ay, by) + radius), height - 1)
        for row in range(first_y, last_y + 1):
            for column in range(first_x, last_x + 1):
                px, py = column + 0.5 - ax, row + 0.5 - ay
                share = 0.0
                if length_squared > 0.0:
                    share = min(max((px * dx + py * dy) / length_squared, 0.0), 1.0)
                off_x, off_y = px - share * dx, py - share * dy
                if off_x * off_x + off_y * off_y <= radius * radius:
                    mask[row, column] = True
