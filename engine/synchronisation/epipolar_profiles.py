"""Where things move as two cameras both see it: motion summed over each plane through the two camera centres.

What moves in one picture lies, at the same moment, in the same plane of this pencil in the other one, however
different the two views are. So the profiles of two cameras over the planes agree when their clocks do.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from engine.camera.projection import pixel_rays
from engine.camera.rig import CameraRig

MAX_BINS = 360
EPIPOLE_SINE = 0.08
"""Rays closer to the line between the cameras than this (sine of the angle) lie in all planes at once and are left
out."""
MIN_SHARED_BINS = 12


def plane_bins(rig: CameraRig, first: int, second: int) -> tuple[np.ndarray, np.ndarray, int] | None:
    """The plane that each pixel of either camera lies in.

    Args:
        rig: At the size of the pictures looked at.
        first: Row of one camera.
        second: Row of the other.
    Returns:
        Bin per pixel of the first and of the second, -1 where it counts for none, and the number of bins; None where
        the cameras stand in one place or see no plane in common. [H * W] int64
    """
    baseline = rig.centers[second] - rig.centers[first]
    length = float(np.linalg.norm(baseline))
    if length < 1e-9:
        return None
    axis = baseline / length
    side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    side /= np.linalg.norm(side)
    up = np.cross(axis, side)
    angles, widths = [], []
    for camera in (first, second):
        width, height = (int(value) for value in rig.image_sizes[camera])
        rays = pixel_rays(rig.Ks[camera], width, height).reshape(-1, 3) @ rig.world_to_camera[camera, :3, :3]
        along, x, y = rays @ axis, rays @ side, rays @ up
        across = np.hypot(x, y)
        angle = np.where(across > EPIPOLE_SINE * np.hypot(across, along), np.arctan2(y, x), np.nan)
        angles.append(angle)
        widths.append(np.nanmedian(np.linalg.norm(rays, axis=1) ** -1 / across) if np.isfinite(angle).any() else 0)
    if min(widths) <= 0:
        return None
    # pixels of a central ray are 1 / f apart: so wide is a plane where it is best resolved
    step = max(1.0 / float(np.sqrt(rig.Ks[camera, 0, 0] * rig.Ks[camera, 1, 1])) for camera in (first, second))
    n_bins = int(min(MAX_BINS * 4, np.ceil(2 * np.pi / (1.5 * step))))
    bins = [np.where(np.isnan(a), -1, np.floor((np.nan_to_num(a) + np.pi) / (2 * np.pi) * n_bins)) for a in angles]
    bins = [b.astype(np.int64).clip(-1, n_bins - 1) for b in bins]
    seen = [np.bincount(b[b >= 0], minlength=n_bins) > 0 for b in bins]
    shared = seen[0] & seen[1]
    if shared.sum() < MIN_SHARED_BINS:
        return None
    number = np.where(shared, np.cumsum(shared) - 1, -1)
    first_bins, second_bins = (np.where(b >= 0, number[b], -1) for b in bins)
    return first_bins, second_bins, int(shared.sum())


def profile(motion: sparse.csr_matrix, bins: np.ndarray, n_bins: int) -> np.ndarray:
    """Motion [T, H * W] summed over each plane. [T, B] float64"""
    rows = np.flatnonzero(bins >= 0)
    to_bins = sparse.csr_matrix((np.ones(len(rows), np.float32), (rows, bins[rows])), shape=(len(bins), n_bins))
    return sparse.csr_matrix(motion @ to_bins).toarray().astype(np.float64)
