"""Calibrations as OpenCV writes them: pixel centres at whole numbers, distortion vectors, rotation vectors.

This is the one place where pixel centres of such calibrations are moved to +0.5.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from engine.camera.lens import Lens
from engine.errors import CaptureError

PIXEL_SHIFT = 0.5
"""OpenCV has the middle of the first pixel at 0, this program at 0.5."""
LENGTHS = (4, 5, 8, 12)
"""Numbers that a distortion vector may have."""


def shifted(K: np.ndarray) -> np.ndarray:
    """K of OpenCV with pixel centres at +0.5. [3, 3]"""
    moved = K.copy()
    moved[:2, 2] += PIXEL_SHIFT
    return moved


def lens_of(distortions: np.ndarray, *, is_fisheye: bool, path: Path) -> Lens:
    """The lens of a distortion vector: k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4]]], or k1 to k4 of a fisheye.

    Args:
        distortions: In any shape; none at all is a pinhole.
        is_fisheye: Whether they are of cv2.fisheye.
        path: The file they come from.
    Raises:
        CaptureError: There are as many numbers as no model has.
    """
    values = np.asarray(distortions, dtype=np.float64).ravel()
    if len(values) == 14 and not values[12:].any():
        values = values[:12]  # a sensor that is not tilted
    if is_fisheye:
        if len(values) >= 4 and not values[4:].any():
            return Lens("fisheye", tuple(values[:4].tolist()))
    elif len(values) in LENGTHS or (len(values) <= 4 and not values.any()):
        return Lens("opencv", tuple(values.tolist())) if values.any() else Lens()
    kind, wanted = ("fisheye lens", "4") if is_fisheye else ("lens", "4, 5, 8 or 12")
    hint = "Export the calibration in OpenCV's order: k1 k2 p1 p2 k3."
    raise CaptureError(f"Its {kind} has {len(values)} parameters, not {wanted}.", hint=hint, path=path)


def pose_of(rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """World-to-camera map of a rotation vector [3] or matrix [3, 3], in any shape, and a translation [3]. [4, 4]"""
    pose = np.eye(4)
    pose[:3, :3] = rotation_matrix(rotation.ravel()) if rotation.size == 3 else rotation.reshape(3, 3)
    pose[:3, 3] = translation.ravel()
    return pose


def rotation_matrix(vector: np.ndarray) -> np.ndarray:
    """The rotation about a vector [3] by its length in radians; NaN of one that is not a number. [3, 3]"""
    if not np.abs(vector).max() < 1e6:  # turns lose their digits, and NaN; check_pose then names the camera
        return np.full((3, 3), math.nan)
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
