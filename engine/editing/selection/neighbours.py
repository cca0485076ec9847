"""Selecting by neighbourhood: what lies near what is selected, and what hangs together with what was clicked.

Points are looked up in a grid of cells as wide as the distance, kept in as many buckets as there are points.
"""

from __future__ import annotations

import numpy as np
from numba import njit


def grown(means: np.ndarray, selected: np.ndarray, distance: float) -> np.ndarray:
    """The selection, and every Gaussian whose centre is within a distance of one of those.

    Args:
        means: Scene units. [N, 3]
        selected: [N] bool
        distance: Scene units.
    Returns:
        [N] bool
    """
    selected = np.ascontiguousarray(selected, np.bool_)
    if not (np.isfinite(distance) and distance > 0.0):
        return selected.copy()
    points, is_sound = _points(means)
    found = np.zeros(len(points), np.bool_)
    starts, items = _grid(points, selected & is_sound, float(distance))
    _near_any(points, is_sound & ~selected, starts, items, float(distance), found)
    return found | selected


def shrunk(means: np.ndarray, selected: np.ndarray, distance: float) -> np.ndarray:
    """The selection without those near the edge: no Gaussian that is not selected lies within a distance of those
    left. Arguments as of `grown`. [N] bool"""
    return ~grown(means, ~np.asarray(selected, np.bool_), distance) & selected


def flooded(means: np.ndarray, colors: np.ndarray, seed: int, distance: float, color_tolerance: float) -> np.ndarray:
    """The Gaussians connected to one Gaussian: from neighbour to neighbour, as long as colours are like its own.

    Args:
        means: Scene units. [N, 3]
        colors: Display-encoded RGB in 0..1. [N, 3]
        seed: Row of the Gaussian.
        distance: Neighbours are at most this far apart, scene units.
        color_tolerance: No channel of a colour differs by more than this from that of the seed.
    Returns:
        [N] bool
    Raises:
        ValueError: There is no such row.
    """
    if not 0 <= seed < len(means):
        raise ValueError(f"there is no Gaussian {seed} among {len(means)}")
    found = np.zeros(len(means), np.bool_)
    points, is_sound = _points(means)
    if not is_sound[seed]:
        return found
    found[seed] = True
    if np.isfinite(distance) and distance > 0.0:
        with np.errstate(invalid="ignore"):
            is_alike = (np.abs(colors - colors[seed]) <= color_tolerance).all(axis=1)
        is_alike[seed] = False
        starts, items = _grid(points, is_alike & is_sound, float(distance))
        _flood(points, starts, items, float(distance), seed, found)
    return found


def _points(means: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    points = np.ascontiguousarray(means, np.float64)
    is_sound = np.all(np.isfinite(points), axis=1, keepdims=True)[:, 0]
    return points, is_sound


def _grid(points: np.ndarray, is_in: np.ndarray, cell: float) -> tuple[np.ndarray, np.ndarray]:
    """Start of every bucket [B + 1], and the rows in the order of buckets."""
    n_buckets = 1 << max(int(np.count_nonzero(is_in)).bit_length(), 4)
    starts = np.zeros(n_buckets + 1, np.int64)
    items = np.empty(int(np.count_nonzero(is_in)), np.int64)
    _fill_grid(points, is_in, cell, starts, items)
    return starts, items


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _cell(value, cell):
    return np.int64(np.floor(min(max(value / cell, -1e15), 1e15)))


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _bucket(ix, iy, iz, n_buckets):
    mixed = ix * np.int64(73856093) ^ iy * np.int64(19349663) ^ iz * np.int64(83492791)
    return (mixed ^ (mixed >> 15)) & (n_buckets - 1)


@njit(cache=True, nogil=True, error_model="numpy")
def _fill_grid(points, is_in, cell, starts, items):
    n_buckets = len(starts) - 1
    for i in range(len(points)):
        if is_in[i]:
            starts[
                _bucket(_cell(points[i, 0], cell), _cell(points[i, 1], cell), _cell(points[i, 2], cell), n_buckets)
            ] += 1
    total = 0
    for bucket in range(n_buckets):
        total += starts[bucket]
        starts[bucket] = total  # its end for now
    starts[n_buckets] = total
    for i in range(len(points)):
        if is_in[i]:
            bucket = _bucket(_cell(points[i, 0], cell), _cell(points[i, 1], cell), _cell(points[i, 2], cell), n_buckets)
            starts[bucket] -= 1
            items[starts[bucket]] = i


@njit(cache=True, nogil=True, error_model="numpy")
def _near_any(points, is_asked, starts, items, distance, found):
    n_buckets = len(starts) - 1
    for i in range(len(points)):
        if not is_asked[i]:
            continue
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        ix, iy, iz = _cell(x, distance), _cell(y, distance), _cell(z, distance)
        for neighbour in range(27):
            bucket = _bucket(ix + neighbour % 3 - 1, iy + neighbour // 3 % 3 - 1, iz + neighbour // 9 - 1, n_buckets)
            for k in range(starts[bucket], starts[bucket + 1]):
                j = items[k]
                dx, dy, dz = points[j, 0] - x, points[j, 1] - y, points[j, 2] - z
                if dx * dx + dy * dy + dz * dz <= distance * distance:
                    found[i] = True
                    break
            if found[i]:
                break


@njit(cache=True, nogil=True, error_model="numpy")
def _flood(points, starts, items, distance, seed, found):
    """Remove the Gaussians reached from the grid, so that none is looked at twice in vain."""
    n_buckets = len(starts) - 1
    ends = starts[1:].copy()
    waiting = np.empty(len(items) + 1, np.int64)
    waiting[0] = seed
    n_waiting = 1
    while n_waiting:
        n_waiting -= 1
        i = waiting[n_waiting]
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        ix, iy, iz = _cell(x, distance), _cell(y, distance), _cell(z, distance)
        for neighbour in range(27):
            bucket = _bucket(ix + neighbour % 3 - 1, iy + neighbour // 3 % 3 - 1, iz + neighbour // 9 - 1, n_buckets)
            k = starts[bucket]
            while k < ends[bucket]:
                j = items[k]
                dx, dy, dz = points[j, 0] - x, points[j, 1] - y, points[j, 2] - z
                if dx * dx + dy * dy + dz * dz <= distance * distance:
                    found[j] = True
                    waiting[n_waiting] = j
                    n_waiting += 1
                    ends[bucket] -= 1
                    items[k] = items[ends[bucket]]
                else:
                    k += 1
