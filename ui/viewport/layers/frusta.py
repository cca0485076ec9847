"""Cameras as pyramids in the picture: how large they are drawn, and which one lies under the pointer. No GL."""

from __future__ import annotations

import numpy as np

from app.playback.views.scene_axes import rig_radius
from engine.camera.projection import to_camera, to_pixels
from engine.camera.rig import CameraRig
from ui.gl.lines import LINES_PER_FRUSTUM, frusta_lines

FRUSTUM_SHARE = 0.09
"""Length of a camera's pyramid as a share of the rig's radius."""
NEAR_SHARE = 1.5
"""A view that is nearer to a camera than this share of its pyramid's length is as good as inside."""


def frustum_size(rig: CameraRig) -> float:
    """Length of a pyramid, scene units."""
    return FRUSTUM_SHARE * rig_radius(rig)


def cameras_around(rig: CameraRig, world_to_camera: np.ndarray, size: float) -> np.ndarray:
    """Cameras in or right before whose pyramids a view stands, such as the one that was just looked through: their
    lines would go right across its picture. [C] bool

    Args:
        world_to_camera: Of the view. [4, 4]
        size: Of the pyramids, scene units.
    """
    eye = -world_to_camera[:3, :3].T @ world_to_camera[:3, 3]
    return np.linalg.norm(rig.centers - eye, axis=1) < NEAR_SHARE * size


def camera_under(
    rig: CameraRig,
    world_to_camera: np.ndarray,
    K: np.ndarray,
    x: float,
    y: float,
    *,
    near: float,
    reach_px: float = 6.0,
) -> int | None:
    """The camera whose pyramid lies under a pixel; of several the one whose lines are nearest to it there.

    Args:
        world_to_camera: Of the view. [4, 4]
        K: Of the picture in which x and y are pixels. [3, 3]
        near: Nothing nearer than this is drawn, scene units.
        reach_px: How near to a line the pointer has to be.
    """
    corners = frusta_lines(rig, frustum_size(rig))[0].astype(np.float64)  # two per line
    points = to_camera(corners, world_to_camera)
    is_before = (points[:, 2] > near).reshape(-1, 2).all(axis=1)
    starts, ends = to_pixels(points, K).reshape(-1, 2, 2).swapaxes(0, 1)  # [L, 2] each
    along = ends - starts
    lengths_squared = np.maximum((along * along).sum(axis=1), 1e-12)
    pointer = np.array([x, y])
    shares = np.clip(((pointer - starts) * along).sum(axis=1) / lengths_squared, 0.0, 1.0)
    away = np.linalg.norm(starts + shares[:, None] * along - pointer, axis=1)
    away = np.where(is_before, away, np.inf).reshape(len(rig), LINES_PER_FRUSTUM).min(axis=1)
    nearest = int(np.argmin(away))
    return nearest if away[nearest] <= reach_px else None
