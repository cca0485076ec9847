"""A hint of the scene before there is any cloud: every camera's picture, placed in space where the cameras look.

Cheap and rough by intention; it shows which camera sees what until the training has built the real cloud.
"""

from __future__ import annotations

import numpy as np

from app.arrays import PointArrays
from app.pictures import downsized
from engine.capture.capture import Capture

PICTURE_WIDTH_PX = 40
DEPTH_SHARE = 0.16
"""The pictures stand this share of the way from their camera to the focus point."""


def picture_hint(capture: Capture, frame_index: int) -> PointArrays:
    """Small pictures of all cameras as points in front of them.

    Raises:
        CaptureError: A picture cannot be decoded.
    """
    rig = capture.rig
    focus = rig.focus_point()
    points, colors = [], []
    for camera in range(len(rig)):
        image = downsized(capture.frame(camera, frame_index), PICTURE_WIDTH_PX)
        height, width = image.shape[:2]
        ratio = rig.image_sizes[camera] / np.array([width, height])
        u, v = np.meshgrid((np.arange(width) + 0.5) * ratio[0], (np.arange(height) + 0.5) * ratio[1])
        pixels = np.stack([u, v, np.ones_like(u)], axis=-1).reshape(-1, 3)
        depth = DEPTH_SHARE * float(np.linalg.norm(focus - rig.centers[camera]))
        p_camera = depth * pixels @ np.linalg.inv(rig.Ks[camera]).T
        rotation, shift = rig.world_to_camera[camera, :3, :3], rig.world_to_camera[camera, :3, 3]
        points.append((p_camera - shift) @ rotation)
        colors.append(image.reshape(-1, 3) / 255.0)
    return PointArrays(
        np.concatenate(points).astype(np.float32),
        np.concatenate(colors).astype(np.float32),
        ("hint", capture.fingerprint, frame_index),
        is_hint=True,
    )
