"""Cameras whose lens was bent to make a wrong place fit: along its view a camera can trade place for focal length.

Such a camera explains its matches within the reach that tells misplaced ones, but less exactly than others do, and its
principal point has been pulled far from the middle. Neither alone says anything: right cameras have one or the other.
"""

from __future__ import annotations

import numpy as np

from engine.calibration.matching.matching import KeyPoints, Pair, epipolar_px
from engine.calibration.solving.cameras import Cameras

QUANTILE = 0.9
"""Of the distances of a pair's matches from their epipolar lines."""
MISSES = 1.3
"""Times what is usual. Misplaced cameras of a real capture: 1.4 to 1.5; right ones 1.2, in rigs of few cameras 1.6."""
OFF_MIDDLE = 0.024
"""Of the picture's width, of a principal point. The same cameras: 0.026 to 0.039; right ones that miss 0.018."""


def is_strained(
    rows: np.ndarray,
    cameras: Cameras,
    key_points: list[KeyPoints],
    verified: dict[Pair, np.ndarray],
    sizes: np.ndarray,
    is_firm: np.ndarray,
) -> np.ndarray:
    """Which cameras are. [R] bool

    Args:
        rows: Which cameras, rising. [R]
        cameras: In this order.
        key_points, verified: Of all cameras.
        sizes: Of all pictures. [C, 2]
        is_firm: Pairs that explain all of their matches, as good as. [R, R]
    """
    planes = [cameras.plane(i, key_points[row].pixels) for i, row in enumerate(rows)]
    misses: list[list[float]] = [[] for _ in rows]
    for a, b in np.argwhere(np.triu(is_firm)).tolist():
        found = verified[int(rows[a]), int(rows[b])]
        off = epipolar_px(cameras, (a, b), planes[a][found[:, 0]], planes[b][found[:, 1]])
        for camera in (a, b):
            misses[camera].append(float(np.quantile(off, QUANTILE)))
    usual = np.array([float(np.median(own)) if own else 0.0 for own in misses])
    if not usual.any():
        return np.zeros(len(rows), dtype=bool)
    off_middle = np.linalg.norm(cameras.principal - sizes[rows] / 2, axis=-1) / sizes[rows, 0]
    return (usual > MISSES * np.median(usual[usual > 0])) & (off_middle > OFF_MIDDLE)
