"""How strongly parts of a clip belong together: near each other, alike, and moving alike, in all frames of the clip."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from engine.objects.moving_parts import MovingParts

N_NEIGHBOURS = 8
MAX_MOMENTS = 6
"""Frames in which neighbours are looked for, evenly spread over the clip."""
COLOR_SPREAD = 0.25
"""Difference of colours at which a bond is at 0.6 of its strength, display-encoded."""
REACH = 1.5
"""The same of distance, in distances to the farthest of these neighbours."""


def bonds(parts: MovingParts) -> csr_matrix:
    """Symmetric strengths of bonds, 0..1, between neighbours in any frame. [N, N]

    Two parts that touch in one frame and are apart in another are not bound: it is the largest distance that counts,
    so that people who touch and part come apart where they do it within the clip.
    """
    n, pairs = len(parts), []
    reach, n_there = np.zeros(n), np.zeros(n)
    moments = np.unique(np.linspace(0, len(parts.frames) - 1, MAX_MOMENTS).round().astype(int))
    for means, opacities in zip(parts.means[moments], parts.opacities[moments], strict=True):
        there = np.flatnonzero(opacities > 0)
        if len(there) < 2:
            continue
        k = min(N_NEIGHBOURS + 1, len(there))
        distances, near = cKDTree(means[there]).query(means[there], k=k)
        reach[there] += distances[:, -1]
        n_there[there] += 1
        first = np.repeat(there, k - 1)
        second = there[near[:, 1:].reshape(-1)]
        pairs.append(np.stack([np.minimum(first, second), np.maximum(first, second)], 1))
    if not pairs:
        return csr_matrix((n, n), dtype=np.float64)
    joined = np.unique(np.concatenate(pairs) @ np.array([n, 1]))
    first, second = np.divmod(joined, n)
    is_other = first != second
    first, second = first[is_other], second[is_other]
    local = reach / np.maximum(n_there, 1)
    local = np.maximum(local, max(0.25 * float(np.median(local[n_there > 0])), 1e-12))
    farthest, nearest = np.zeros(len(first), np.float32), np.full(len(first), np.inf, np.float32)
    for means, opacities in zip(parts.means, parts.opacities, strict=True):
        both = (opacities[first] > 0) & (opacities[second] > 0)
        away = np.linalg.norm(means[first] - means[second], axis=1)
        farthest = np.where(both, np.maximum(farthest, away), farthest)
        nearest = np.where(both, np.minimum(nearest, away), nearest)
    scale = REACH * 0.5 * (local[first] + local[second])
    change = np.where(np.isfinite(nearest), farthest - nearest, 0.0)
    unlike = np.linalg.norm(parts.colors[first] - parts.colors[second], axis=1)
    strength = np.exp(-0.5 * ((farthest / scale) ** 2 + (change / scale) ** 2 + (unlike / COLOR_SPREAD) ** 2))
    half = csr_matrix((strength.astype(np.float64), (first, second)), shape=(n, n))
    return (half + half.T).tocsr()
