"""A view's facts from a rig: the lens and the pose of a camera, and the camera that the home view begins at."""

from __future__ import annotations

import numpy as np

from app.playback.views.view_motion import Pose
from engine.camera.projection import camera_center, vertical_fov
from engine.camera.rig import CameraRig


def camera_fov(rig: CameraRig, camera: int) -> float:
    """Vertical field of view, radians."""
    return vertical_fov(float(rig.Ks[camera, 1, 1]), float(rig.image_sizes[camera, 1]))


def fitted_K(rig: CameraRig, camera: int, width: int, height: int) -> np.ndarray:
    """Intrinsics of a camera whose picture is fitted into a viewport and centred. [3, 3] float64"""
    image_width, image_height = (float(v) for v in rig.image_sizes[camera])
    scale = min(width / image_width, height / image_height)
    K = rig.Ks[camera].copy()
    K[:2] *= scale
    K[0, 2] += (width - scale * image_width) / 2
    K[1, 2] += (height - scale * image_height) / 2
    return K


def camera_pose(rig: CameraRig, camera: int, *, otherwise: float) -> Pose:
    """A camera as a pose about a pivot ahead of it, as far away as the scene.

    Args:
        otherwise: Distance of the pivot where the scene does not lie ahead, scene units.
    """
    return free_pose(rig, rig.world_to_camera[camera], camera_fov(rig, camera), otherwise=otherwise)


def free_pose(rig: CameraRig | None, world_to_camera: np.ndarray, fov_y: float, *, otherwise: float) -> Pose:
    """Any camera as a pose about a pivot ahead of it, as far away as the rig's focus. See `camera_pose`."""
    eye, rotation = camera_center(world_to_camera), world_to_camera[:3, :3]
    focus = eye if rig is None or not len(rig) else rig.focus_point()
    ahead = float((focus - eye) @ rotation[2])
    distance = ahead if ahead > 1e-3 else otherwise
    return Pose(rotation, eye + distance * rotation[2], distance, distance, fov_y)


def home_camera(rig: CameraRig, focus: np.ndarray, up: np.ndarray) -> int:
    """A camera that looks level and stands in the middle of the others.

    A dome's mean direction points straight up; only its level part counts, so that the home view is not from above.

    Args:
        focus: The point that the cameras look at, scene units. [3]
        up: Unit vector. [3]
    """
    offsets = rig.centers - focus
    directions = offsets / np.maximum(np.linalg.norm(offsets, axis=1, keepdims=True), 1e-9)
    heights = directions @ up
    level_mean = directions.mean(0) - heights.mean() * up
    return int(np.argmax(directions @ level_mean - 0.5 * np.abs(heights)))
