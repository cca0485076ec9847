"""The motion from one camera to another on which background and moving parts agree.

Where cameras are far apart, most that looks alike is alike and not the same: a ball from all sides, tiles, a room that
is nearly symmetric. One such thing makes hundreds of matches that fit one motion well, a wrong one. But a ball
that rolls and a floor that does not move are wrong in different ways: right motions are those that both speak for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from engine.calibration.matching.matching import KeyPoints, Pair, homogeneous
from engine.parallel import map_ordered

N_TRIALS = 250
REACH_PX = 4.0
"""At a width of 640, from the epipolar line; focal lengths are not known yet."""
FOCAL_PER_SIDE = 0.8
"""Of the trials. Matches fit a motion for any focal length that is near; the motion itself is found anew for each."""
MIN_STILL, MIN_MOVING = 20, 12
MIN_STILL_SHARE, MIN_MOVING_SHARE = 0.55, 0.3
"""Matches that fit, and their shares of all, for a pair to count. Neighbours 36 degrees apart of the sample, which is a
hard scene: from 28 and 21, 0.58 and 0.4; pairs that are wrong reach such shares only between opposite cameras."""


@dataclass(frozen=True, slots=True)
class AgreedMotion:
    """Matches of a pair that fit one motion.

    Attributes:
        rows: Rows of key points in both. [M, 2]
        worth: The geometric mean of how many of the background fit, and how many of moving parts, of which those beyond
            twice as many do not count: one thing that looks alike from all sides can have hundreds.
    """

    rows: np.ndarray
    worth: float


def agreed_motions(
    key_points: list[KeyPoints],
    matches: dict[Pair, np.ndarray],
    sizes: np.ndarray,
    advance: Callable[[float], None] = lambda _: None,
) -> dict[Pair, AgreedMotion]:
    """Pairs of cameras with a motion that background and moving parts agree on.

    Args:
        key_points: Of all cameras.
        matches: By looks alone.
        sizes: Width and height of all pictures. [C, 2]
        advance: Called with 1 by any thread whenever a pair is done.
    """

    def one(pair: Pair) -> AgreedMotion | None:
        found = _agreed(pair, matches[pair], key_points, sizes)
        advance(1.0)
        return found

    pairs = sorted(matches)
    found = zip(pairs, map_ordered(one, pairs), strict=True)
    return {pair: motion for pair, motion in found if motion is not None}


def on_planes(pair: Pair, rows: np.ndarray, key_points: list[KeyPoints], sizes: np.ndarray, focal: float):
    """Both ends of matches on planes at depth 1, without distortion, for a focal length per longer side. Two [M, 2]"""
    ends = zip(pair, rows.T, strict=True)
    return tuple((key_points[c].pixels[own] - sizes[c] / 2) / (focal * sizes[c].max()) for c, own in ends)


def _agreed(pair: Pair, rows: np.ndarray, key_points: list[KeyPoints], sizes: np.ndarray) -> AgreedMotion | None:
    is_moving = key_points[pair[0]].moments[rows[:, 0]] > 0
    still, moving = np.flatnonzero(~is_moving), np.flatnonzero(is_moving)
    if len(still) < MIN_STILL or len(moving) < MIN_MOVING:
        return None
    first, second = on_planes(pair, rows, key_points, sizes, FOCAL_PER_SIDE)
    reach = REACH_PX / 640 / FOCAL_PER_SIDE
    generator = np.random.default_rng(0)
    worth, is_fitting = 0.0, np.zeros(len(rows), dtype=bool)
    for trial in range(N_TRIALS):
        n_still = 2 + trial % 2
        chosen = np.concatenate(
            [generator.choice(still, n_still, replace=False), generator.choice(moving, 5 - n_still, replace=False)]
        )
        found, _ = cv2.findEssentialMat(first[chosen], second[chosen], np.eye(3), method=cv2.RANSAC)
        if found is None or not np.isfinite(found).all():
            continue
        for essential in found.reshape(-1, 3, 3):
            fits = _off(essential, first, second) < reach
            value = _worth(int(fits[still].sum()), int(fits[moving].sum())) + 0.02 * float(fits.sum())
            if value > worth:
                worth, is_fitting = value, fits
    n_still, n_moving = int(is_fitting[still].sum()), int(is_fitting[moving].sum())
    if n_still < max(MIN_STILL, MIN_STILL_SHARE * len(still)):
        return None
    if n_moving < max(MIN_MOVING, MIN_MOVING_SHARE * len(moving)):
        return None
    return AgreedMotion(rows[is_fitting], worth)


def _worth(n_still: int, n_moving: int) -> float:
    return float(np.sqrt(n_still * min(n_moving, 2 * n_still)))


def _off(essential: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Sampson distance on planes at depth 1. [M]"""
    lines_b, lines_a = homogeneous(first) @ essential.T, homogeneous(second) @ essential
    slopes = (lines_b[:, :2] ** 2).sum(-1) + (lines_a[:, :2] ** 2).sum(-1)
    return np.abs((homogeneous(second) * lines_b).sum(-1)) / np.sqrt(np.maximum(slopes, 1e-18))
