"""Corrections of cameras: small changes of pose and focal length that a training found.

Seven numbers per camera: a rotation vector and a translation, applied after world_to_camera, and a log focal factor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from engine.camera.rig import CameraRig

N_VALUES = 7
"""Rotation vector (radians, camera axes), translation (scene units, camera axes), log of the factor of fx and fy."""
ROTATION, TRANSLATION, LOG_FOCAL = slice(0, 3), slice(3, 6), 6


def corrected(rig: CameraRig, names: Sequence[str], corrections: np.ndarray | None) -> CameraRig:
    """A rig with some of its cameras corrected; all others stay exactly as they are.

    Args:
        names: Cameras that the corrections belong to; those that the rig lacks are passed over.
        corrections: Theirs, see `N_VALUES`; None where nothing was corrected. [len(names), 7]
    """
    if corrections is None:
        return rig
    world_to_camera, Ks = rig.world_to_camera.copy(), rig.Ks.copy()
    for name, values in zip(names, corrections.astype(np.float64), strict=True):
        if name not in rig.names or not values.any():
            continue
        camera = rig.names.index(name)
        world_to_camera[camera], Ks[camera] = corrected_camera(world_to_camera[camera], Ks[camera], values)
    return replace(rig, world_to_camera=world_to_camera, Ks=Ks)


def corrected_camera(world_to_camera: np.ndarray, K: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pose [4, 4] and intrinsics [3, 3] of one camera after its correction [7]."""
    pose, changed = world_to_camera.copy(), K.copy()
    rotation, _ = turn(values[ROTATION])
    pose[:3] = rotation @ world_to_camera[:3]
    pose[:3, 3] += values[TRANSLATION]
    changed[0, 0] *= np.exp(values[LOG_FOCAL])
    changed[1, 1] *= np.exp(values[LOG_FOCAL])
    return pose, changed


def turn(vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation about a vector by its length in radians, and its left Jacobian. [3, 3] each

    The Jacobian J says how the rotation turns on: that of vector + d is the one of J @ d after that of vector.
    """
    angle = float(np.linalg.norm(vector))
    x, y, z = vector
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if angle < 1e-6:  # the terms left out are smaller than rounding
        return np.eye(3) + cross + cross @ cross / 2, np.eye(3) + cross / 2 + cross @ cross / 6
    a, b = np.sin(angle) / angle, (1 - np.cos(angle)) / angle**2
    square = cross @ cross
    return np.eye(3) + a * cross + b * square, np.eye(3) + b * cross + (1 - a) / angle**2 * square
