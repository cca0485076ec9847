"""Geometry-aware deduplication: which points of a clip are not already covered by the reference clip's points.

Every inherited point owns a sphere; the union's signed distance is min_i(|q - p_i| - r_i), exactly. Testing only the
nearest centre is not the union: a farther but larger sphere may cover q (18 % against 10 % kept on random points).
Source: ClipGStream, geometry-aware deduplication.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from engine.parallel import n_cores

FIRST_NEIGHBORS = 8


def union_distance(points: np.ndarray, centers: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Signed distance to the union of spheres: min over i of |points - centers_i| - radii_i, negative inside.

    Args:
        points: [P, 3]
        centers: [S, 3]
        radii: Not negative. [S]
    Returns:
        float64 [P]; +inf where there are no spheres.
    Raises:
        ValueError: A radius is negative or not finite, or the lengths differ.

    Exact: spheres are searched in bands of similar radius (factor 2). In a band, once the k-th nearest centre is
    farther than (best so far + largest radius of the band), no other sphere of the band can be closer.
    """
    points, centers = np.asarray(points, dtype=np.float64), np.asarray(centers, dtype=np.float64)
    radii = np.asarray(radii, dtype=np.float64)
    if radii.shape != (len(centers),):
        raise ValueError(f"{len(centers)} centers need as many radii, got shape {radii.shape}")
    if not (np.isfinite(radii).all() and (radii >= 0).all()):
        raise ValueError("sphere radii must be finite and not negative")
    best = np.full(len(points), np.inf)
    if len(centers) == 0 or len(points) == 0:
        return best
    floor = max(float(radii.max()) * 2.0**-20, 1e-300)
    bands = np.floor(np.log2(np.maximum(radii, floor))).astype(int)
    for band in np.unique(bands)[::-1]:  # large spheres first: they decide most points and prune the rest
        rows = np.flatnonzero(bands == band)
        _search_band(points, centers[rows], radii[rows], best)
    return best


def residual_rows(
    candidates: np.ndarray, inherited_points: np.ndarray, inherited_radii: np.ndarray, *, tolerance: float = 0.0
) -> np.ndarray:
    """Candidates outside the union of inherited spheres by more than tolerance (scene units). bool [P]"""
    return union_distance(candidates, inherited_points, inherited_radii) > tolerance


def mean_neighbor_distance(points: np.ndarray, k: int = 3) -> np.ndarray:
    """Mean distance of each point to its k nearest others (fewer if there are fewer; 0 for a lone point). [P]"""
    return neighbor_distances(points, k).mean(axis=1)


def neighbor_distances(points: np.ndarray, k: int) -> np.ndarray:
    """Distances of each point to its k nearest others, or to all of fewer; one of 0 for a lone point. [P, k]"""
    points = np.asarray(points, dtype=np.float64)
    n_neighbors = min(k, len(points) - 1)
    if n_neighbors < 1:
        return np.zeros((len(points), 1))
    distances, _ = KDTree(points).query(points, n_neighbors + 1, workers=n_cores())
    return distances[:, 1:]


def _search_band(points: np.ndarray, centers: np.ndarray, radii: np.ndarray, best: np.ndarray) -> None:
    """Lower best [P] in place to the distance to this band's spheres where that is smaller."""
    tree, largest = KDTree(centers), float(radii.max())
    open_rows = np.arange(len(points))
    k = min(FIRST_NEIGHBORS, len(centers))
    while len(open_rows):
        distances, neighbors = tree.query(points[open_rows], k, workers=n_cores())
        distances, neighbors = distances.reshape(-1, k), neighbors.reshape(-1, k)
        best[open_rows] = np.minimum(best[open_rows], (distances - radii[neighbors]).min(axis=1))
        if k == len(centers):
            return
        open_rows = open_rows[distances[:, -1] - largest < best[open_rows]]
        k = min(4 * k, len(centers))
