"""Weighted means per voxel. Deterministic: voxels come out sorted by index, sums run in input order."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def voxel_keys(points: np.ndarray, size: float) -> np.ndarray:
    """Integer cell of every point, packed into one int64 per point (21 bits per axis). [P]

    Raises:
        ValueError: The points span more than 2^20 cells along an axis.
    """
    if len(points) == 0:
        return np.zeros(0, dtype=np.int64)
    cells = np.floor(points / size).astype(np.int64)
    cells -= cells.min(0)
    if cells.max() >= 1 << 20:
        raise ValueError(f"points span {cells.max()} voxels of {size:g} along one axis, at most {1 << 20} fit")
    return (cells[:, 0] << 42) | (cells[:, 1] << 21) | cells[:, 2]


def voxel_means(
    points: np.ndarray, size: float, columns: Sequence[np.ndarray], weights: np.ndarray
) -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
    """Weighted mean point and columns of each occupied voxel.

    Args:
        points: [P, 3]
        size: Voxel edge, scene units.
        columns: Further arrays to average, each [P, k].
        weights: Positive. [P]
    Returns:
        points [V, 3], columns each [V, k], summed weights [V].
    """
    if len(points) == 0:
        return points.copy(), [column.copy() for column in columns], weights.copy()
    _, voxel = np.unique(voxel_keys(points, size), return_inverse=True)
    totals = np.bincount(voxel, weights)

    def mean(values: np.ndarray) -> np.ndarray:
        sums = [np.bincount(voxel, weights * values[:, i]) for i in range(values.shape[1])]
        return np.stack(sums, axis=1) / totals[:, None]

    return mean(points), [mean(column) for column in columns], totals
