"""Which key points of two cameras look alike, at equal times only.

All key points of a still camera, those of its background and of several moments, form one list. A point of one moment
is only ever compared with points of the same moment, so that whatever moves helps as a calibration board would.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from engine.calibration.solving.cameras import Cameras, skew
from engine.parallel import map_ordered

MAX_RATIO = 0.85
"""Distance of the best match divided by that of the second best."""
MAX_DISTANCE = 0.8
"""Distance of unit descriptors."""
TWIN_PX = 3.0
"""Key points that near each other are one place with several directions or sizes: no rivals of each other."""
N_RIVALS = 6
"""Best matches that are looked at for one that is not a twin."""
Pair = tuple[int, int]


@dataclass(frozen=True, slots=True)
class KeyPoints:
    """Key points of one camera.

    Attributes:
        pixels: [K, 2] float64, centres at +0.5
        moments: 0 for the background, then numbers of the moments. [K]
        descriptors: Unit length. [K, 128] float32
    """

    pixels: np.ndarray
    moments: np.ndarray
    descriptors: np.ndarray

    def __len__(self) -> int:
        return len(self.pixels)


def all_pairs(n_cameras: int) -> list[Pair]:
    """Every two cameras, once."""
    return [(a, b) for a in range(n_cameras) for b in range(a + 1, n_cameras)]


def match_all(key_points: list[KeyPoints], advance: Callable[[float], None] = lambda _: None) -> dict[Pair, np.ndarray]:
    """Matches of every two cameras by looks alone: rows of key points in both. {pair: [M, 2]}

    Args:
        key_points: Of all cameras.
        advance: Called with 1 by any thread whenever a pair is done.
    """

    def one(pair: Pair) -> np.ndarray:
        first, second = (key_points[i] for i in pair)
        found = [np.zeros((0, 2), dtype=np.int64)]
        for rows_a, rows_b in _equal_moments(first, second):
            alike = first.descriptors[rows_a] @ second.descriptors[rows_b].T
            chosen = _mutual_best(alike, second.pixels[rows_b], first.pixels[rows_a], MAX_RATIO)
            found.append(np.stack([rows_a[chosen[:, 0]], rows_b[chosen[:, 1]]], axis=-1))
        advance(1.0)
        return np.concatenate(found)

    pairs = all_pairs(len(key_points))
    return dict(zip(pairs, map_ordered(one, pairs), strict=True))


def homogeneous(plane: np.ndarray) -> np.ndarray:
    """Points [K, 2] with a 1 behind them. [K, 3]"""
    return np.concatenate([plane, np.ones((len(plane), 1))], axis=1)


def essential_matrix(cameras: Cameras, a: int, b: int) -> np.ndarray:
    """The matrix E with plane_b . E plane_a = 0 for the same point. [3, 3]"""
    rotation = cameras.rotations[b] @ cameras.rotations[a].T
    return skew(cameras.translations[b] - rotation @ cameras.translations[a]) @ rotation


def epipolar_px(cameras: Cameras, pair: Pair, plane_a: np.ndarray, plane_b: np.ndarray) -> np.ndarray:
    """Sampson distance of matches, points [M, 2] on the planes of two cameras, in pixels. [M]"""
    essential = essential_matrix(cameras, *pair)
    line_b, line_a = homogeneous(plane_a) @ essential.T, homogeneous(plane_b) @ essential
    products = (homogeneous(plane_b) * line_b).sum(-1)
    slopes = (line_b[:, :2] ** 2).sum(-1) / cameras.focals[pair[1]] ** 2
    slopes += (line_a[:, :2] ** 2).sum(-1) / cameras.focals[pair[0]] ** 2
    return np.abs(products) / np.sqrt(np.maximum(slopes, 1e-18))


def _equal_moments(first: KeyPoints, second: KeyPoints):
    """Rows of key points of each moment that both cameras have."""
    for moment in np.intersect1d(first.moments, second.moments):
        yield np.flatnonzero(first.moments == moment), np.flatnonzero(second.moments == moment)


def _mutual_best(alike: np.ndarray, pixels_b: np.ndarray, pixels_a: np.ndarray, max_ratio: float) -> np.ndarray:
    """Pairs of rows and columns that are each other's best, clearly better than the next. [M, 2]"""
    if min(alike.shape) == 0:
        return np.zeros((0, 2), dtype=np.int64)
    rows = np.arange(len(alike))
    best_b = alike.argmax(1)
    is_mutual = alike.argmax(0)[best_b] == rows
    best = alike[rows, best_b]
    is_near = _distance(best) < MAX_DISTANCE
    chosen = rows[is_mutual & is_near]
    is_clear = _is_clear(alike[chosen], best_b[chosen], pixels_b, max_ratio)
    is_clear &= _is_clear(alike[:, best_b[chosen]].T, chosen, pixels_a, max_ratio)
    chosen = chosen[is_clear]
    return np.stack([chosen, best_b[chosen]], axis=-1)


def _is_clear(alike: np.ndarray, best: np.ndarray, pixels: np.ndarray, max_ratio: float) -> np.ndarray:
    """Whether the best column of each row beats every other that is not its twin. [rows]"""
    if not len(alike):
        return np.zeros(0, dtype=bool)
    n = min(N_RIVALS, alike.shape[1])
    columns = np.argpartition(alike, alike.shape[1] - n, axis=1)[:, -n:]
    rivals = np.take_along_axis(alike, columns, axis=1)
    is_twin = ((pixels[columns] - pixels[best][:, None]) ** 2).sum(-1) < TWIN_PX**2
    rivals[is_twin] = -1.0
    return _distance(alike[np.arange(len(alike)), best]) < max_ratio * _distance(rivals.max(1))


def _distance(products: np.ndarray) -> np.ndarray:
    return np.sqrt(np.maximum(2 - 2 * products, 0.0))
