"""Cubic curves through keyed values, of camera paths and of volumes that move: what lies between keys, reached exactly
at each.

Tangents come from the parabola through a key and its neighbours, and are then held back where they would run past a
key: between two keys nothing turns back, and two equal keys stand still.
"""

from __future__ import annotations

import numpy as np

_MAX_SLOPE = 2.0
"""A tangent is at most so many times as fast as the slower of the two pieces at its key; up to 3 nothing turns back."""


def tangents_of(steps: np.ndarray, lengths: np.ndarray, *, is_loop: bool = False) -> np.ndarray:
    """Change per frame at every key.

    Args:
        steps: From key to key, at least one. [P, D]
        lengths: Of the pieces, frames. [P]
        is_loop: Whether the last key is the first one again.
    Returns:
        [P + 1, D]
    """
    slopes = steps / lengths[:, None]
    if is_loop:
        inner = _inner_tangents(np.concatenate([slopes[-1:], slopes]), np.concatenate([lengths[-1:], lengths]))
        return np.concatenate([inner, inner[:1]])
    inner = _inner_tangents(slopes, lengths)
    if not len(inner):
        return np.concatenate([slopes, slopes])
    start, stop = 1.5 * slopes[0] - 0.5 * inner[0], 1.5 * slopes[-1] - 0.5 * inner[-1]  # nothing bends at the ends
    return np.concatenate([start[None], inner, stop[None]])


def along_curve(
    values: np.ndarray, tangents: np.ndarray, lengths: np.ndarray, piece: np.ndarray, share: np.ndarray
) -> np.ndarray:
    """Points of a curve.

    Args:
        values, tangents: At the keys. [P + 1, D]
        lengths: Of the pieces, frames. [P]
        piece: In which piece each point lies. [F] int64
        share: How far along it, 0..1. [F]
    Returns:
        [F, D]
    """
    t, length = share[:, None], lengths[piece][:, None]
    step = values[piece + 1] - values[piece]
    rest = length * ((1 - t) * tangents[piece] - t * tangents[piece + 1]) + (2 * t - 1) * step
    return values[piece] + t * step + t * (1 - t) * rest


def _inner_tangents(slopes: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Tangents between neighbouring pieces with these slopes [P, D] and lengths [P]. [P - 1, D]

    That of the parabola through three keys, without what would lead back along one of the pieces, and never much
    faster than the slower of them.
    """
    before, after = slopes[:-1], slopes[1:]
    h0, h1 = lengths[:-1, None], lengths[1:, None]
    tangents = (h1 * before + h0 * after) / (h0 + h1)
    for slope in (before, after):
        square = np.maximum((slope * slope).sum(-1, keepdims=True), 1e-300)
        back = np.minimum((tangents * slope).sum(-1, keepdims=True), 0.0)
        tangents = tangents - back / square * slope
    slower = np.minimum(np.linalg.norm(before, axis=-1), np.linalg.norm(after, axis=-1))[:, None]
    speed = np.maximum(np.linalg.norm(tangents, axis=-1), 1e-300)[:, None]
    return tangents * np.minimum(1.0, _MAX_SLOPE * slower / speed)
