"""Gaussians in a picture: where their centres lie, how far away they are, and how wide they look. One compiled kernel.

The projection is the rasterizer's (3DGS): the lens is linearised at each centre. In float64, because an orthographic
view stands so far away that float32 could not separate depths.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from engine.conventions import FRUSTUM_MARGIN
from engine.editing.selection.seen_from import SeenFrom


@dataclass(frozen=True, slots=True, eq=False)
class ProjectedGaussians:
    """Gaussians as a view sees them, a row each. Rows behind the camera or not finite hold zeros.

    Attributes:
        view: The view.
        centers: px. [N, 2] float64
        depths: Of the centres along the viewing direction, scene units. [N] float64
        spreads: Covariances of x, y (px) and depth: xx, xy, yy, xz, yz, zz; without the rasterizer's low-pass. [N, 6]
            float64
        is_before: Whether the row is finite and its centre before the camera. [N] bool
    """

    view: SeenFrom
    centers: np.ndarray
    depths: np.ndarray
    spreads: np.ndarray
    is_before: np.ndarray

    def __len__(self) -> int:
        return len(self.depths)


def project_gaussians(means: np.ndarray, quats: np.ndarray, scales: np.ndarray, view: SeenFrom) -> ProjectedGaussians:
    """Project Gaussians into the picture of a view.

    Args:
        means: Scene units. [N, 3]
        quats: wxyz, of any length but zero. [N, 4]
        scales: Standard deviations, scene units. [N, 3]
    """
    n = len(means)
    centers, depths = np.zeros((n, 2)), np.zeros(n)
    spreads, is_before = np.zeros((n, 6)), np.zeros(n, np.bool_)
    pose = np.ascontiguousarray(view.world_to_camera[:3], np.float64)
    K = view.K
    lens = np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2]], np.float64)
    size = np.array([view.width, view.height], np.float64)
    means, quats, scales = (np.ascontiguousarray(array, np.float32) for array in (means, quats, scales))
    _project(means, quats, scales, pose, lens, size, max(view.near, 1e-9), centers, depths, spreads, is_before)
    return ProjectedGaussians(view, centers, depths, spreads, is_before)


@njit(cache=True, nogil=True, error_model="numpy")
def _project(means, quats, scales, pose, lens, size, near, centers, depths, spreads, is_before):
    fx, fy, cx, cy = lens[0], lens[1], lens[2], lens[3]
    low_x, high_x = -cx / fx - FRUSTUM_MARGIN * size[0] / fx, (size[0] - cx) / fx + FRUSTUM_MARGIN * size[0] / fx
    low_y, high_y = -cy / fy - FRUSTUM_MARGIN * size[1] / fy, (size[1] - cy) / fy + FRUSTUM_MARGIN * size[1] / fy
    axes = np.empty((3, 3))
    for i in range(len(means)):
        mx, my, mz = np.float64(means[i, 0]), np.float64(means[i, 1]), np.float64(means[i, 2])
        x = pose[0, 0] * mx + pose[0, 1] * my + pose[0, 2] * mz + pose[0, 3]
        y = pose[1, 0] * mx + pose[1, 1] * my + pose[1, 2] * mz + pose[1, 3]
        z = pose[2, 0] * mx + pose[2, 1] * my + pose[2, 2] * mz + pose[2, 3]
        qw, qx = np.float64(quats[i, 0]), np.float64(quats[i, 1])
        qy, qz = np.float64(quats[i, 2]), np.float64(quats[i, 3])
        norm = qw * qw + qx * qx + qy * qy + qz * qz
        reach = np.float64(scales[i, 0]) + np.float64(scales[i, 1]) + np.float64(scales[i, 2])
        if not (z > near and np.isfinite(x + y + z) and norm > 1e-30 and np.isfinite(norm) and np.isfinite(reach)):
            continue
        two = 2.0 / norm
        axes[0, 0], axes[0, 1], axes[0, 2] = (
            1.0 - two * (qy * qy + qz * qz),
            two * (qx * qy - qw * qz),
            two * (qx * qz + qw * qy),
        )
        axes[1, 0], axes[1, 1], axes[1, 2] = (
            two * (qx * qy + qw * qz),
            1.0 - two * (qx * qx + qz * qz),
            two * (qy * qz - qw * qx),
        )
        axes[2, 0], axes[2, 1], axes[2, 2] = (
            two * (qx * qz - qw * qy),
            two * (qy * qz + qw * qx),
            1.0 - two * (qx * qx + qy * qy),
        )
        slope_x, slope_y = min(max(x / z, low_x), high_x), min(max(y / z, low_y), high_y)
        xx = xy = yy = xz = yz = zz = 0.0
        for axis in range(3):
            scale = np.float64(scales[i, axis])
            ex = pose[0, 0] * axes[0, axis] + pose[0, 1] * axes[1, axis] + pose[0, 2] * axes[2, axis]
            ey = pose[1, 0] * axes[0, axis] + pose[1, 1] * axes[1, axis] + pose[1, 2] * axes[2, axis]
            ez = pose[2, 0] * axes[0, axis] + pose[2, 1] * axes[1, axis] + pose[2, 2] * axes[2, axis]
            u = scale * fx / z * (ex - slope_x * ez)
            v = scale * fy / z * (ey - slope_y * ez)
            w = scale * ez
            xx += u * u
            xy += u * v
            yy += v * v
            xz += u * w
            yz += v * w
            zz += w * w
        if not np.isfinite(xx + yy + zz):
            continue
        centers[i, 0], centers[i, 1], depths[i] = fx * x / z + cx, fy * y / z + cy, z
        spreads[i, 0], spreads[i, 1], spreads[i, 2] = xx, xy, yy
        spreads[i, 3], spreads[i, 4], spreads[i, 5] = xz, yz, zz
        is_before[i] = True
