"""Which Gaussians lie in a volume: in a box that may be turned, or in a sphere."""

from __future__ import annotations

import numpy as np

from engine.camera.rotations import matrices_of
from engine.editing.edit import Box, Sphere
from engine.editing.selection.in_picture import EXTENT_SIGMAS


def in_volume(
    volume: Box | Sphere,
    means: np.ndarray,
    *,
    quats: np.ndarray | None = None,
    scales: np.ndarray | None = None,
) -> np.ndarray:
    """Gaussians whose centre lies in a volume; the border belongs to it.

    Args:
        means: Scene units. [N, 3]
        quats, scales: Where they are given, it is enough that a Gaussian reaches into the volume: that it does so
            within EXTENT_SIGMAS, in each direction of the box's axes, or towards the middle of the sphere. wxyz [N, 4],
            scene units [N, 3]
    Returns:
        [N] bool
    """
    offsets = np.asarray(means, np.float64) - np.asarray(volume.center)
    with np.errstate(invalid="ignore"):
        if isinstance(volume, Sphere):
            distances = np.linalg.norm(offsets, axis=1)
            if quats is not None and scales is not None:
                towards = offsets / np.maximum(distances, 1e-30)[:, None]
                distances = distances - EXTENT_SIGMAS * _sigmas(quats, scales, towards[:, None])[:, 0]
            return distances <= volume.radius
        axes = matrices_of(np.asarray(volume.quat) / np.linalg.norm(volume.quat)).T  # rows are the axes of the box
        beside = np.abs(offsets @ axes.T)
        if quats is not None and scales is not None:
            beside = beside - EXTENT_SIGMAS * _sigmas(quats, scales, axes[None])
        is_in = np.all(beside <= np.asarray(volume.half_sizes), axis=1, keepdims=True)[:, 0]
    return is_in


def _sigmas(quats: np.ndarray, scales: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Standard deviations along directions of unit length. directions: [N or 1, D, 3]; returns [N, D]"""
    quats = np.asarray(quats, np.float64)
    norms = np.linalg.norm(quats, axis=1, keepdims=True)
    rotations = matrices_of(quats / np.where(norms > 0.0, norms, np.nan))
    along = (directions @ rotations) * np.asarray(scales, np.float64)[:, None, :]
    return np.linalg.norm(along, axis=2)
