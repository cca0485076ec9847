"""Which points of a cloud become anchors where there may only be so many, and which anchor stands in for the others.

Points are places that something's surface passes through, half of them in a single frame of the clip, and an anchor's
Gaussians reach its neighbours. So first come points that no chosen one reaches yet, those first that reach most places
in most frames; when every point is within reach of a chosen one, what is left of the budget goes to the others in the
same order. Deterministic: equal points in the order of the cloud.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

NOBODY = -1


def choose_within_budget(
    points: np.ndarray, presence: np.ndarray, *, budget: int, reach: float
) -> tuple[np.ndarray, np.ndarray]:
    """Choose at most `budget` points.

    Args:
        points: [P, 3]
        presence: Frames in which each is there. [P, M] bool
        budget: Most points to choose; at least 0.
        reach: How far a chosen point stands in for others, units of the points.
    Returns:
        is_chosen: [P] bool
        stand_in: The nearest chosen point within reach, itself where it is chosen, NOBODY where there is none. [P]
    """
    n_points = len(points)
    if n_points <= budget:
        return np.ones(n_points, bool), np.arange(n_points)
    pairs = KDTree(points).query_pairs(reach, output_type="ndarray")
    first = np.concatenate([pairs[:, 0], pairs[:, 1]])
    second = np.concatenate([pairs[:, 1], pairs[:, 0]])
    n_present = presence.sum(1).astype(np.int64)
    gains = n_present + np.bincount(first, n_present[second], n_points).astype(np.int64)
    order = np.argsort(-gains, kind="stable")
    is_first = _apart(order, first, second)
    order = np.concatenate([order[is_first[order]], order[~is_first[order]]])
    chosen = np.sort(order[:budget])
    is_chosen = np.zeros(n_points, bool)
    is_chosen[chosen] = True
    stand_in = np.full(n_points, NOBODY, np.int64)
    if budget:
        distances, nearest = KDTree(points[chosen]).query(points)
        stand_in = np.where(distances <= reach, chosen[nearest], NOBODY)
    stand_in[chosen] = chosen
    return is_chosen, stand_in


def _apart(order: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Points taken in this order, each unless a neighbour was taken before. Edges first[i], second[i]. [P] bool"""
    by_first = np.argsort(first, kind="stable")
    neighbors = second[by_first]
    starts = np.searchsorted(first[by_first], np.arange(len(order) + 1))
    is_taken, is_reached = np.zeros(len(order), bool), np.zeros(len(order), bool)
    for row in order.tolist():
        if not is_reached[row]:
            is_taken[row] = True
            is_reached[neighbors[starts[row] : starts[row + 1]]] = True
    return is_taken
