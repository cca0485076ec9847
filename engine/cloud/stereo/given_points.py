"""Are points that came with a capture true? Pictures of neighbouring cameras are compared at them.

A point on a surface looks alike in two cameras that stand next to each other. So does, where there is little texture,
one in front of the surface or behind it. Therefore each point competes against others on the same ray: a true one wins
far more often than by chance, one of another world or moment does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.camera.projection import is_in_picture, project, projection_matrices
from engine.camera.rig import CameraRig
from engine.images.image_filters import block_mean

N_NEIGHBORS = 2
"""Cameras that each one is compared with, the nearest first."""
PATCH_PX = 3
"""Pixels from the middle of a patch to its border."""
COMPARED_WIDTH = 480
"""Pictures are made smaller, to about this width: points need not be exact to the pixel of a large picture."""
RIVALS = (0.86, 0.91, 0.955, 1.047, 1.1, 1.16)
"""Depths of the points that each one competes with, as a share of its own."""
MIN_SHARE = 0.22
"""Share of points that must win. By chance 0.14 do; on the sample 0.64 of the triangulated points, 0.57 of all
surfaces, 0.48 with noise of 1 % of the depth, 0.26 of a world that is 5 % too large and 0.15 of one 20 % too large."""
MIN_POINTS = 50
GREY_FROM_RGB = np.array([0.299, 0.587, 0.114])
MAX_POINTS = 20_000
"""Of more points so many are looked at: depth ranges need no more."""


@dataclass(frozen=True, slots=True)
class GivenPoints:
    """The findings about a cloud.

    Attributes:
        points: Those that win, float64; empty where the cloud is not used. [P, 3]
        share: Of the points that two cameras see, those that win.
        n_seen: Points that two cameras see.
    """

    points: np.ndarray
    share: float
    n_seen: int

    @property
    def is_used(self) -> bool:
        """Whether the cloud is true enough."""
        return len(self.points) > 0


def true_points(points: np.ndarray, backgrounds: np.ndarray, is_stable: np.ndarray, rig: CameraRig) -> GivenPoints:
    """The points of a cloud that look more alike in neighbouring cameras than others on their rays, if many do.

    Args:
        points: In the world of the rig. [P, 3]
        backgrounds: One picture per camera without what moves. [C, H, W, 3] uint8
        is_stable: False where a background cannot be trusted. [C, H, W] bool
        rig: At the size of the backgrounds, at least two cameras.
    """
    rows = np.unique(np.linspace(0, len(points) - 1, min(len(points), MAX_POINTS)).round().astype(np.int64))
    points = np.asarray(points, np.float64)[rows]
    if len(points) == 0 or len(rig) < 2:
        return GivenPoints(np.zeros((0, 3)), 0.0, 0)
    width = is_stable.shape[2]
    factor = max(1, round(width / COMPARED_WIDTH))
    pictures = np.stack([block_mean(picture, factor) @ GREY_FROM_RGB for picture in backgrounds])
    stable = np.stack([block_mean(mask, factor) > 0.5 for mask in is_stable])
    scale = np.diag([1.0 / factor, 1.0 / factor, 1.0])
    projections = scale @ projection_matrices(rig)
    n_seen, n_won = np.zeros(len(points), np.int64), np.zeros(len(points), np.int64)
    for a, b in _pairs(rig):
        has_seen, has_won = _compete(points, rig.centers[a], pictures, stable, projections, a, b)
        n_seen += has_seen
        n_won += has_won
    is_seen, is_won = n_seen > 0, (n_won > 0) & (2 * n_won >= n_seen)
    share = float(is_won[is_seen].mean()) if is_seen.any() else 0.0
    is_true = share >= MIN_SHARE and is_won.sum() >= MIN_POINTS
    return GivenPoints(points[is_won] if is_true else np.zeros((0, 3)), share, int(is_seen.sum()))


def _pairs(rig: CameraRig) -> list[tuple[int, int]]:
    """Each camera with those next to it that look the same way, each pair once."""
    distances = np.linalg.norm(rig.centers[:, None] - rig.centers, axis=-1)
    turned = 1.0 - rig.forwards @ rig.forwards.T  # 0 where two look the same way, 2 where against each other
    cost = distances + turned * np.median(distances)
    np.fill_diagonal(cost, np.inf)
    nearest = np.argsort(cost, axis=1)[:, : min(N_NEIGHBORS, len(rig) - 1)]
    return [(a, int(b)) for a, row in enumerate(nearest) for b in row]


def _compete(
    points: np.ndarray,
    center: np.ndarray,
    pictures: np.ndarray,
    stable: np.ndarray,
    projections: np.ndarray,
    a: int,
    b: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Points that cameras a and b see, and those that win against their rivals on the rays of a. Twice [P] bool"""
    seen, patches = _patches(points, pictures[a], stable[a], projections[a])
    costs = np.full((1 + len(RIVALS), len(points)), np.inf)
    for row, share in enumerate((1.0, *RIVALS)):
        has_own, own = _patches(center + share * (points - center), pictures[b], stable[b], projections[b])
        both = seen & has_own
        costs[row, both] = np.abs(own[both] - patches[both]).mean(axis=1)
    has_seen = np.isfinite(costs).sum(axis=0) > len(RIVALS) // 2
    has_seen &= np.isfinite(costs[0])
    return has_seen, has_seen & (costs[0] < costs[1:].min(axis=0))


def _patches(
    points: np.ndarray, picture: np.ndarray, stable: np.ndarray, projection: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where a camera sees points with a whole patch [P] bool, and the patches less their means [P, N] float32."""
    height, width = picture.shape
    size = 2 * PATCH_PX + 1
    pixels, depths = project(points, projection)
    seen = is_in_picture(pixels, depths, width, height)
    corners = np.floor(np.where(seen[:, None], pixels, 0.0)).astype(np.int64) - PATCH_PX
    seen &= (corners >= 0).all(axis=1) & (corners + size <= [width, height]).all(axis=1)
    x, y = corners[seen].T
    seen[seen] = stable[y + PATCH_PX, x + PATCH_PX]
    x, y = corners[seen].T
    span = np.arange(size)
    patches = np.zeros((len(points), size * size), np.float32)
    values = picture[y[:, None, None] + span[:, None], x[:, None, None] + span].reshape(-1, size * size)
    patches[seen] = values - values.mean(axis=1, keepdims=True)
    return seen, patches
