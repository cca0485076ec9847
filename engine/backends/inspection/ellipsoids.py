"""Gaussians as solid ellipsoids, lit from above the camera: where they are, how large and how they lie. One compiled
kernel.
"""

from __future__ import annotations

import numpy as np
import torch
from numba import njit

from engine.backends.reference.raster import rotation_matrices
from engine.raster.gaussians import Gaussians
from engine.raster.limits import QUAT_NORM_SQUARED_MIN, VALUE_MAX
from engine.raster.pinhole_view import PinholeView

ISO = 1.5
"""Where a body ends, in standard deviations of its Gaussian."""
MIN_OPACITY = 0.1
"""Fainter Gaussians are left out: they are hardly seen, and would hide the others."""
MIN_SCALE_SHARE = 1e-3
"""No axis of a body is shorter than this share of its longest one."""
AMBIENT = 0.25
"""Share of a colour that is seen where no light falls."""
LIGHT = (-0.35, -0.55, -0.76)
"""Direction towards the light in camera axes."""


@torch.no_grad()
def ellipsoids(
    gaussians: Gaussians, view: PinholeView, background: tuple[float, float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Draw every Gaussian as a body with the surface at ISO standard deviations, in its own colour, shaded.

    Left out are those that are fainter than MIN_OPACITY, that cannot be drawn, and that are not wholly beyond the near
    plane.

    Args:
        gaussians: float32, in main memory.
        background: Display-encoded RGB where nothing is.
    Returns:
        image: Display-encoded RGB. [H, W, 3] float32
        depths: Camera depth of the nearest surface, +inf where nothing is, scene units. [H, W] float32
    """
    image = np.empty((view.height, view.width, 3), np.float32)
    image[:] = background
    depths = np.full((view.height, view.width), np.inf, np.float32)
    rows = _bodies(gaussians, view)
    if len(rows) == 0:
        return image, depths
    drawn = gaussians[torch.from_numpy(rows)]
    rotation = view.rotation
    means = drawn.means.numpy().astype(np.float64) @ rotation.T + view.translation
    scales = ISO * drawn.scales.numpy().astype(np.float64)
    scales = np.maximum(scales, MIN_SCALE_SHARE * scales.max(axis=1, keepdims=True))
    axes = rotation @ rotation_matrices(drawn.quats.double()).numpy()  # columns are the axes of a body
    spread = axes * scales[:, None, :]
    boxes, is_seen = _boxes(means, spread @ spread.swapaxes(1, 2), view)
    shapes = axes / scales[:, None, :]
    shapes = shapes @ shapes.swapaxes(1, 2)  # x^T shapes x = 1 on the surface
    colors = np.clip(drawn.colors.numpy(), 0.0, 1.0)
    light = np.array(LIGHT) / np.linalg.norm(LIGHT)
    lens = np.array([view.fx, view.fy, view.cx, view.cy])
    _draw(means[is_seen], shapes[is_seen], boxes[is_seen], colors[is_seen], lens, light, depths, image)
    return image, depths


def _bodies(gaussians: Gaussians, view: PinholeView) -> np.ndarray:
    """Rows that have a body beyond the near plane. [R] int64"""
    means, quats, scales, opacities, colors = (tensor.numpy() for tensor in gaussians.tensors())
    with np.errstate(invalid="ignore"):  # rows that are not finite are left out below
        depths = means @ view.rotation[2].astype(np.float32) + np.float32(view.translation[2])
    longest = np.max(scales, axis=1, initial=0.0)
    is_finite = (np.abs(means) < VALUE_MAX).all(axis=1) & (np.abs(colors) < VALUE_MAX).all(axis=1)
    is_turned = (quats * quats).sum(axis=1) > QUAT_NORM_SQUARED_MIN
    is_body = np.isfinite(scales).all(axis=1) & (scales >= 0.0).all(axis=1) & (longest > 0.0)
    is_before = depths - np.float32(ISO) * longest > view.near_plane
    return np.flatnonzero(
        is_finite & is_turned & np.isfinite(quats).all(axis=1) & is_body & is_before & (opacities >= MIN_OPACITY)
    )


def _boxes(means: np.ndarray, spread: np.ndarray, view: PinholeView) -> tuple[np.ndarray, np.ndarray]:
    """First and last pixel of every body, exactly: the outline of an ellipsoid is a conic, whose dual gives its box.

    Args:
        means: In camera axes. [R, 3]
        spread: axes diag(scales^2) axes^T, in camera axes. [R, 3, 3]
    Returns:
        boxes: First x, first y, last x, last y, cut to the picture. [R, 4] int64
        is_seen: Whether any pixel is left. [R] bool
    """
    dual = spread - means[:, :, None] * means[:, None, :]
    sides = []
    for axis, (focal, center) in enumerate(((view.fx, view.cx), (view.fy, view.cy))):
        middle = dual[:, axis, 2] / dual[:, 2, 2]
        half = np.sqrt(np.maximum(middle**2 - dual[:, axis, axis] / dual[:, 2, 2], 0.0))
        sides.append((focal * (middle - half) + center, focal * (middle + half) + center))
    low = np.ceil(np.stack([sides[0][0], sides[1][0]], 1) - 0.5)
    high = np.floor(np.stack([sides[0][1], sides[1][1]], 1) - 0.5)
    size = np.array([view.width, view.height], np.float64)
    low, high = np.clip(low, 0.0, size), np.clip(high, -1.0, size - 1.0)
    return np.concatenate([low, high], 1).astype(np.int64), np.all(low <= high, axis=1)


@njit(cache=True, nogil=True, error_model="numpy")
def _draw(means, shapes, boxes, colors, lens, light, depths, image):
    for i in range(len(means)):
        mx, my, mz = means[i, 0], means[i, 1], means[i, 2]
        xx, xy, xz = shapes[i, 0, 0], shapes[i, 0, 1], shapes[i, 0, 2]
        yy, yz, zz = shapes[i, 1, 1], shapes[i, 1, 2], shapes[i, 2, 2]
        # shapes @ mean, so that a ray's own product with it is three multiplications
        px, py, pz = xx * mx + xy * my + xz * mz, xy * mx + yy * my + yz * mz, xz * mx + yz * my + zz * mz
        c = px * mx + py * my + pz * mz - 1.0
        for y in range(boxes[i, 1], boxes[i, 3] + 1):
            dy = (y + 0.5 - lens[3]) / lens[1]
            for x in range(boxes[i, 0], boxes[i, 2] + 1):
                dx = (x + 0.5 - lens[2]) / lens[0]
                qx, qy, qz = xx * dx + xy * dy + xz, xy * dx + yy * dy + yz, xz * dx + yz * dy + zz
                a = qx * dx + qy * dy + qz
                b = px * dx + py * dy + pz
                inside = b * b - a * c
                if inside <= 0.0:
                    continue
                depth = (b - np.sqrt(inside)) / a  # of the nearer of two points, along the axis
                if depth >= depths[y, x] or depth <= 0.0:
                    continue
                depths[y, x] = depth
                nx, ny, nz = qx * depth - px, qy * depth - py, qz * depth - pz
                length = np.sqrt(nx * nx + ny * ny + nz * nz)
                shade = AMBIENT + (1.0 - AMBIENT) * max((nx * light[0] + ny * light[1] + nz * light[2]) / length, 0.0)
                for channel in range(3):
                    image[y, x, channel] = colors[i, channel] * shade
