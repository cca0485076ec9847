"""How far one picture of a still camera lies off another one: shift, turn and zoom that bring them together.

Only places with an edge count, and those that changed otherwise, such as people, count less and less.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

N_PLACES = 4000
"""Pixels with the strongest edges that are compared."""
SIGMAS_PX = (4.0, 2.0, 1.0)
"""Pictures are smoothed by so much, one after the other: large shifts are found first."""
N_ROUNDS = 6
SOFT_GRAY = 6.0
"""Grey levels beyond which a difference counts less and less."""


@dataclass(frozen=True, slots=True)
class Alignment:
    """The motion between two pictures.

    Attributes:
        shift_px: Root mean square by which places of the picture move, px.
        before, after: Robust mean difference in grey without and with the motion.
    """

    shift_px: float
    before: float
    after: float


def align(first: np.ndarray, second: np.ndarray) -> Alignment:
    """Find the motion from one picture to another one of the same size. [h, w] uint8 each"""
    height, width = first.shape
    motion = np.zeros(4)  # x, y, turn, zoom about the middle
    places = np.zeros((0, 2), dtype=np.int64)
    before = after = 0.0
    half = max(width, height) / 2
    gain = _gain(first, second)
    for sigma in SIGMAS_PX:
        still = gaussian_filter(first.astype(np.float64) * gain, sigma)
        moved = gaussian_filter(second.astype(np.float64), sigma)
        slope_y, slope_x = np.gradient(still)
        strength = np.hypot(slope_x, slope_y)
        margin = min(8, height // 8, width // 8)
        inner = np.zeros_like(strength, dtype=bool)
        inner[margin : height - margin, margin : width - margin] = True
        flat = np.flatnonzero(inner & (strength > 0.5))
        if len(flat) < 50:
            return Alignment(0.0, 0.0, 0.0)
        strongest = flat[np.argsort(-strength.flat[flat], kind="stable")[:N_PLACES]]
        places = np.stack([strongest % width, strongest // width], axis=-1)
        x, y = places[:, 0] - width / 2, places[:, 1] - height / 2
        columns = np.stack([np.ones_like(x), np.zeros_like(x), -y / half, x / half], -1)
        rows = np.stack([np.zeros_like(x), np.ones_like(x), x / half, y / half], -1)
        slopes = slope_x.flat[strongest][:, None] * columns + slope_y.flat[strongest][:, None] * rows
        target = still.flat[strongest]

        def difference(motion: np.ndarray, columns=columns, rows=rows, x=x, y=y, moved=moved, target=target):
            at = np.stack([y + height / 2 + rows @ motion, x + width / 2 + columns @ motion])
            return map_coordinates(moved, at, order=1, mode="nearest") - target

        before = _robust_mean(difference(np.zeros(4)))
        best = motion
        least = _robust_mean(difference(motion))
        for _ in range(N_ROUNDS):
            errors = difference(motion)
            weights = 1.0 / (1.0 + (errors / SOFT_GRAY) ** 2)
            weighted = slopes * weights[:, None]
            step = np.linalg.lstsq(weighted.T @ slopes + 1e-6 * np.eye(4), weighted.T @ errors, rcond=None)[0]
            motion = motion - step
            cost = _robust_mean(difference(motion))
            if cost < least:
                least, best = cost, motion
        motion, after = best, least
    x, y = places[:, 0] - width / 2, places[:, 1] - height / 2
    moved_x = motion[0] - y / half * motion[2] + x / half * motion[3]
    moved_y = motion[1] + x / half * motion[2] + y / half * motion[3]
    return Alignment(float(np.sqrt((moved_x**2 + moved_y**2).mean())), before, after)


def _gain(first: np.ndarray, second: np.ndarray) -> float:
    """By how much the second is brighter."""
    low = np.maximum(first.astype(np.float64), 1.0)
    return float(np.clip(np.median(second / low), 0.5, 2.0))


def _robust_mean(errors: np.ndarray) -> float:
    return float(SOFT_GRAY * np.sqrt(np.log1p((errors / SOFT_GRAY) ** 2).mean()))
