"""Which Gaussians lie in a volume: in a box or a prism that may be turned, or in a sphere."""

from __future__ import annotations

import numpy as np

from engine.camera.rotations import matrices_of
from engine.editing.edit import Prism, Sphere, Volume
from engine.editing.selection.in_picture import EXTENT_SIGMAS
from engine.editing.volumes.outlines import in_outline
from engine.editing.volumes.prisms import in_prism, own_points, widths_at


def in_volume(
    volume: Volume,
    means: np.ndarray,
    *,
    quats: np.ndarray | None = None,
    scales: np.ndarray | None = None,
) -> np.ndarray:
    """Gaussians whose centre lies in a volume; the border belongs to it.

    Args:
        means: Scene units. [N, 3]
        quats, scales: Where they are given, it is enough that a Gaussian reaches into the volume: that it does so
            within EXTENT_SIGMAS, in each direction of the box's axes, towards the middle of the sphere, or towards the
            nearest place of the prism's outline. wxyz [N, 4], scene units [N, 3]
    Returns:
        [N] bool
    """
    if isinstance(volume, Prism):
        is_in = in_prism(volume, means)
        return is_in if quats is None or scales is None else is_in | _reaches_into(volume, means, quats, scales)
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


def _reaches_into(prism: Prism, means: np.ndarray, quats: np.ndarray, scales: np.ndarray) -> np.ndarray:
    """Gaussians with their centres outside a prism that reach into it. [N] bool"""
    own = own_points(prism, means)
    axes = matrices_of(np.asarray(prism.quat) / np.linalg.norm(prism.quat))  # columns are the axes of the prism
    sizes, corners = np.asarray(prism.half_sizes), np.array(prism.outline)
    with np.errstate(invalid="ignore"):
        ends = np.abs(own[:, 2]) * sizes[2] - EXTENT_SIGMAS * _sigmas(quats, scales, axes.T[None, 2:])[:, 0]
        near = np.flatnonzero(ends <= sizes[2])
    is_in = np.zeros(len(own), bool)
    depths = np.clip(own[near, 2], -1.0, 1.0)
    widths = sizes[:2] * widths_at(prism, depths)[:, None]  # [n, 2], scene units per unit of the outline
    starts, steps = corners, np.roll(corners, -1, axis=0) - corners
    for row, point, width in zip(near, own[near, :2], widths, strict=True):
        firsts, ways = (starts - point) * width, steps * width
        shares = -(firsts * ways).sum(axis=1) / np.maximum((ways * ways).sum(axis=1), 1e-300)
        offsets = firsts + np.clip(shares, 0.0, 1.0)[:, None] * ways
        to_border = offsets[np.linalg.norm(offsets, axis=1).argmin()]
        away = float(np.linalg.norm(to_border))
        direction = axes[:, :2] @ (to_border / max(away, 1e-30))
        one = slice(row, row + 1)
        is_in[row] = away <= EXTENT_SIGMAS * _sigmas(quats[one], scales[one], direction[None, None])[0, 0]
    inside = in_outline(own[near, :2], prism.outline)
    is_in[near] |= inside
    return is_in


def _sigmas(quats: np.ndarray, scales: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Standard deviations along directions of unit length. directions: [N or 1, D, 3]; returns [N, D]"""
    quats = np.asarray(quats, np.float64)
    norms = np.linalg.norm(quats, axis=1, keepdims=True)
    rotations = matrices_of(quats / np.where(norms > 0.0, norms, np.nan))
    along = (directions @ rotations) * np.asarray(scales, np.float64)[:, None, :]
    return np.linalg.norm(along, axis=2)
