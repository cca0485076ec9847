"""Carrying: what is known of the parts of one clip, said of the parts of its neighbour, which are other Gaussians.

At the border of two clips both show the same moment, or nearly: parts of the one lie where parts of the other do, and
look alike.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from engine.objects.moving_parts import MovingParts

N_NEIGHBOURS = 12
COLOR_SPREAD = 0.2
"""See engine.objects.neighbours."""


def carried(known: MovingParts, values: np.ndarray, asked: MovingParts) -> tuple[np.ndarray, np.ndarray]:
    """Values of the parts of a clip for those of the clip before or after it.

    Args:
        known: Its parts.
        values: Of each of them, 0..1. [N]
        asked: Of the neighbouring clip.
    Returns:
        Values [M], and how surely they are known, 0..1 [M]: 0 where nothing was near, and of what is not there at the
        border.
    """
    is_end = known.start < asked.start
    sources, opaque = known.at_border(is_end=is_end)
    targets, shown = asked.at_border(is_end=not is_end)
    from_, to = np.flatnonzero(opaque > 0), np.flatnonzero(shown > 0)
    value, surety = np.zeros(len(asked)), np.zeros(len(asked))
    if not len(from_) or not len(to):
        return value, surety
    k = min(N_NEIGHBOURS, len(from_))
    distances, near = KDTree(sources[from_]).query(targets[to], k=k)
    distances, near = distances.reshape(len(to), k), near.reshape(len(to), k)
    own, _ = KDTree(sources[from_]).query(sources[from_], k=k)
    usual = max(float(np.median(own.reshape(len(from_), k)[:, -1])), 1e-9)
    near = from_[near]
    unlike = np.linalg.norm(known.colors[near] - asked.colors[to][:, None], axis=2)
    weight = opaque[near] * np.exp(-0.5 * ((distances / usual) ** 2 + (unlike / COLOR_SPREAD) ** 2))
    total = weight.sum(1)
    value[to] = (weight * values[near]).sum(1) / np.maximum(total, 1e-12)
    surety[to] = np.minimum(total, 1.0)
    return value, surety
