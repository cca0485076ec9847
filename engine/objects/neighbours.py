"""How strongly parts of a clip belong together: near each other, alike, and moving alike, in all frames of the clip."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import KDTree

from engine.objects.moving_parts import MovingParts

N_NEIGHBOURS = 6
COLOR_SPREAD = 0.2
"""Difference of colours at which a bond is at 0.6 of its strength, display-encoded."""
REACH = 1.5
"""The same of distance, in distances to the farthest of these neighbours."""
N_BEFORE = 4
"""Parts of the frame before that something new in a frame is bound to."""
SUCCESSION = 1.0
"""Strength of such a bond against one between parts that are there at the same time."""


def bonds(parts: MovingParts) -> csr_matrix:
    """Symmetric strengths of bonds, 0..1, between neighbours in any frame. [N, N]

    Two parts that touch in one frame and are apart in another are not bound: it is the largest distance that counts,
    so that people who touch and part come apart where they do it within the clip. What moves fast is made of parts that
    last for a frame or two: something new is bound to what was in its place before, as that has moved on.
    """
    n = len(parts)
    first, second, local = _neighbours(parts)
    if not len(first):
        return csr_matrix((n, n), dtype=np.float64)
    farthest, nearest = np.zeros(len(first), np.float32), np.full(len(first), np.inf, np.float32)
    for means, opacities in zip(parts.means, parts.opacities, strict=True):
        both = (opacities[first] > 0) & (opacities[second] > 0)
        away = np.linalg.norm(means[first] - means[second], axis=1)
        farthest = np.where(both, np.maximum(farthest, away), farthest)
        nearest = np.where(both, np.minimum(nearest, away), nearest)
    change = np.where(np.isfinite(nearest), farthest - nearest, 0.0)
    half = _strengths(parts, first, second, np.hypot(farthest, change), local)
    half = half.maximum(SUCCESSION * _succession(parts, local))
    return half.maximum(half.T).tocsr()


def _neighbours(parts: MovingParts) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs that are neighbours in some frame, the first one of each with the smaller number, [E] each; and how far the
    neighbours of each part are. [N]"""
    n, pairs = len(parts), []
    reach, n_there = np.zeros(n), np.zeros(n)
    for means, opacities in zip(parts.means, parts.opacities, strict=True):
        there = np.flatnonzero(opacities > 0)
        if len(there) < 2:
            continue
        k = min(N_NEIGHBOURS + 1, len(there))
        distances, near = KDTree(means[there]).query(means[there], k=k)
        reach[there] += distances[:, -1]
        n_there[there] += 1
        one, other = np.repeat(there, k - 1), there[np.asarray(near)[:, 1:].reshape(-1)]
        pairs.append(np.minimum(one, other) * n + np.maximum(one, other))
    if not pairs:
        return np.zeros(0, np.int64), np.zeros(0, np.int64), reach
    first, second = np.divmod(np.unique(np.concatenate(pairs)), n)
    is_other = first != second
    local = reach / np.maximum(n_there, 1)
    least = 0.25 * float(np.median(local[n_there > 0]))
    return first[is_other], second[is_other], np.maximum(local, max(least, 1e-12))


def _succession(parts: MovingParts, local: np.ndarray) -> csr_matrix:
    """Bonds of what is new in a frame with what was there before. [N, N]"""
    n = len(parts)
    firsts, seconds, aways = [], [], []
    for place in range(1, len(parts.frames)):
        before, now = parts.opacities[place - 1] > 0, parts.opacities[place] > 0
        new, both, old = np.flatnonzero(now & ~before), np.flatnonzero(now & before), np.flatnonzero(before)
        if not len(new) or not len(both):
            continue
        step = parts.means[place, both] - parts.means[place - 1, both]
        was = parts.means[place - 1, old]
        k = min(3, len(both))
        near = np.asarray(KDTree(parts.means[place - 1, both]).query(was, k=k)[1]).reshape(len(old), k)
        expected = was + step[near].mean(1)
        k = min(N_BEFORE, len(old))
        away, near = KDTree(expected).query(parts.means[place, new], k=k)
        firsts.append(np.repeat(new, k))
        seconds.append(old[near.reshape(-1)])
        aways.append(away.reshape(-1))
    if not firsts:
        return csr_matrix((n, n), dtype=np.float64)
    first, second, away = np.concatenate(firsts), np.concatenate(seconds), np.concatenate(aways)
    _, once = np.unique(first * n + second, return_index=True)
    return _strengths(parts, first[once], second[once], away[once], local)


def _strengths(
    parts: MovingParts, first: np.ndarray, second: np.ndarray, away: np.ndarray, local: np.ndarray
) -> csr_matrix:
    scale = REACH * 0.5 * (local[first] + local[second])
    unlike = np.linalg.norm(parts.colors[first] - parts.colors[second], axis=1)
    strength = np.exp(-0.5 * ((away / scale) ** 2 + (unlike / COLOR_SPREAD) ** 2))
    return csr_matrix((strength.astype(np.float64), (first, second)), shape=(len(parts), len(parts)))
