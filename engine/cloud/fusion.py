"""One point cloud from many depth maps: trust in tiers, flatten onto local planes, average per voxel.

Points that only one camera sees and that no other camera contradicts are kept: without them there are black holes.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from engine.cloud.voxel import voxel_means
from engine.parallel import n_cores

logger = logging.getLogger(__name__)

TIER_WEIGHTS = (1.0, 0.3, 0.1)
"""Weight of agreed, filled-and-agreed and filled-alone pixels in every mean."""
TIER_DISTANCES = (0.0, 1.0, 1.5)
"""A lower tier only adds points at least this many spacings from the better ones."""
N_PLANE_NEIGHBORS = 20
OUTLIER_NEIGHBORS = 20
OUTLIER_STD_RATIO = 2.5


@dataclass(frozen=True, slots=True)
class Samples:
    """Oriented coloured points of one trust tier. points, normals (unit), colors: each [P, 3]."""

    points: np.ndarray
    normals: np.ndarray
    colors: np.ndarray


def fuse_tiers(tiers: list[Samples], spacing: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fuse samples of at most three tiers, best first, into about one point per voxel of edge `spacing`.

    Returns:
        points [P, 3], normals [P, 3], colors [P, 3], float64.
    """
    points, normals, colors = (np.zeros((0, 3)) for _ in range(3))
    weights = np.zeros(0)
    for samples, weight, distance in zip(tiers, TIER_WEIGHTS, TIER_DISTANCES, strict=False):
        if len(samples.points) == 0:
            continue
        own_weights = np.full(len(samples.points), weight)
        new, (new_normals, new_colors), new_weights = voxel_means(
            samples.points, spacing / 2, [samples.normals, samples.colors], own_weights
        )
        if len(points) and distance > 0:
            is_apart = KDTree(points).query(new, workers=n_cores())[0] > distance * spacing
            new, new_normals, new_colors, new_weights = (
                a[is_apart] for a in (new, new_normals, new_colors, new_weights)
            )
        points, normals, colors = (
            np.concatenate(pair) for pair in ((points, new), (normals, new_normals), (colors, new_colors))
        )
        weights = np.concatenate([weights, new_weights])
    if len(points) == 0:
        return points, normals, colors
    for _ in range(2):
        points, normals = project_to_planes(points, normals, weights, radius=2 * spacing)
    points, (normals, colors), _ = voxel_means(points, spacing, [normals, colors], weights)
    return points, _unit(normals), colors


def project_to_planes(
    points: np.ndarray, normals: np.ndarray, weights: np.ndarray, *, radius: float
) -> tuple[np.ndarray, np.ndarray]:
    """Move each point along the mean normal of its neighbours onto their weighted mean plane (moving least squares).

    Args:
        radius: Neighbour weights fall with exp(-(distance / radius)^2).
    """
    n_neighbors = min(N_PLANE_NEIGHBORS, len(points))
    distances, neighbors = KDTree(points).query(points, n_neighbors, workers=n_cores())
    distances, neighbors = distances.reshape(len(points), -1), neighbors.reshape(len(points), -1)
    pull = weights[neighbors] * np.exp(-((distances / radius) ** 2))
    centers = np.einsum("pk,pki->pi", pull, points[neighbors]) / pull.sum(1)[:, None]
    planes = _unit(np.einsum("pk,pki->pi", pull, _unit(normals)[neighbors]))
    return points - ((points - centers) * planes).sum(1, keepdims=True) * planes, planes


def keep_inliers(
    points: np.ndarray, *, n_neighbors: int = OUTLIER_NEIGHBORS, std_ratio: float = OUTLIER_STD_RATIO
) -> np.ndarray:
    """Open3D's statistical outlier removal. Rows to keep, bool [P].

    Open3D holds the GIL while it works, so this belongs in a process without a window. Where its system libraries are
    missing it cannot be imported; the same rule on scipy's neighbours then takes its place, at about twice the time.
    """
    if len(points) <= n_neighbors:
        return np.ones(len(points), dtype=bool)
    try:
        import open3d  # deferred: 900 MB of libraries, wanted by the worker only
    except ImportError as error:
        logger.warning("Open3D cannot be loaded (%s); outliers are removed with scipy instead", error)
        return _keep_inliers_scipy(points, n_neighbors=n_neighbors, std_ratio=std_ratio)
    is_kept = np.zeros(len(points), dtype=bool)
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(np.ascontiguousarray(points, dtype=np.float64)))
    _, rows = cloud.remove_statistical_outlier(n_neighbors, std_ratio)
    is_kept[np.asarray(rows, dtype=np.int64)] = True
    return is_kept


def _keep_inliers_scipy(points: np.ndarray, *, n_neighbors: int, std_ratio: float) -> np.ndarray:
    """The rule of Open3D's filter: a point's mean distance to its neighbours, itself counted, may exceed the mean of
    all points by `std_ratio` standard deviations."""
    distances = KDTree(points).query(points, k=n_neighbors)[0].mean(axis=1)  # [P]
    return distances < distances.mean() + std_ratio * distances.std(ddof=1)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)
