"""Epipolar errors of matches under a calibration, in pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from engine.camera.rig import CameraRig
from engine.features.matching import PairMatches


@dataclass(frozen=True, slots=True)
class PairError:
    """How well the calibration of two cameras fits what both see.

    Attributes:
        first, second: Rows of the rig.
        n_matches: Matches behind it.
        median_px: Half of them are within this distance of the lines on which they must lie; NaN without matches.
    """

    first: int
    second: int
    n_matches: int
    median_px: float


def fundamental_matrices(Ks: np.ndarray, poses: np.ndarray, other_Ks: np.ndarray, other_poses: np.ndarray):
    """F with other_pixel . F pixel = 0 for the same point.

    Args:
        Ks, other_Ks: [..., 3, 3] of the first and of the second cameras, which broadcast
        poses, other_poses: world_to_camera. [..., 4, 4]
    Returns:
        [..., 3, 3]
    """
    rotation = other_poses[..., :3, :3] @ np.swapaxes(poses[..., :3, :3], -1, -2)
    shift = other_poses[..., :3, 3] - (rotation @ poses[..., :3, 3, None])[..., 0]
    zero = np.zeros_like(shift[..., 0])
    x, y, z = shift[..., 0], shift[..., 1], shift[..., 2]
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*shift.shape[:-1], 3, 3)
    return np.swapaxes(np.linalg.inv(other_Ks), -1, -2) @ cross @ rotation @ np.linalg.inv(Ks)


def sampson_px(F: np.ndarray, pixels: np.ndarray, other_pixels: np.ndarray) -> np.ndarray:
    """Signed distance by which matches miss the epipolar geometry, to first order.

    Args:
        F: Of each match, or one for all. [M, 3, 3] or [3, 3]
        pixels, other_pixels: [M, 2]
    Returns:
        px. [M]
    """
    ones = np.ones((len(pixels), 1))
    here, there = np.concatenate([pixels, ones], 1), np.concatenate([other_pixels, ones], 1)
    lines = (F @ here[:, :, None])[..., 0]  # in the other picture
    back = (np.swapaxes(F, -1, -2) @ there[:, :, None])[..., 0]
    slope = (lines[:, :2] ** 2).sum(1) + (back[:, :2] ** 2).sum(1)
    return (there * lines).sum(1) / np.sqrt(np.maximum(slope, 1e-18))


def pair_errors(rig: CameraRig, pairs: Sequence[PairMatches]) -> list[PairError]:
    """The error of each pair. The rig is at the size of the matched pictures."""
    found = []
    for pair in pairs:
        a, b = pair.first, pair.second
        F = fundamental_matrices(rig.Ks[a], rig.world_to_camera[a], rig.Ks[b], rig.world_to_camera[b])
        errors = np.abs(sampson_px(F, pair.pixels, pair.other_pixels))
        found.append(PairError(a, b, len(pair), float(np.median(errors)) if len(pair) else float("nan")))
    return found
