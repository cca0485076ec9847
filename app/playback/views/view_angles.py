"""Yaw, pitch and roll against how a camera is turned. numpy only; radians.

A positive pitch looks down, a positive roll leans to the right. Also defined for views straight up and down.
"""

from __future__ import annotations

import math

import numpy as np

from app.playback.views.scene_axes import cross, horizontal_axes

NO_ROLL = 1e-9
"""Smaller ones come from rounding."""


def rotation_of(up: np.ndarray, yaw: float, pitch: float, roll: float = 0.0) -> np.ndarray:
    """Right, down and forward directions of a camera as rows. up: Unit vector, [3]. [3, 3]"""
    e0, e1 = horizontal_axes(up)
    level = math.cos(yaw) * e0 + math.sin(yaw) * e1
    forward = math.cos(pitch) * level - math.sin(pitch) * up
    right = cross(level, up)
    down = cross(forward, right)
    rolled = math.cos(roll) * right + math.sin(roll) * down
    return np.stack([rolled, cross(forward, rolled), forward])


def angles_of(up: np.ndarray, rotation: np.ndarray) -> tuple[float, float, float]:
    """Yaw, pitch and roll of a camera; straight up and down the roll is 0.

    Args:
        up: Unit vector. [3]
        rotation: Right, down and forward directions as rows. [3, 3]
    """
    right, _, forward = rotation
    e0, e1 = horizontal_axes(up)
    rise = float(np.clip(forward @ up, -1.0, 1.0))
    level = forward - rise * up
    if float(np.linalg.norm(level)) < 1e-6:  # then the right direction gives the yaw
        level = cross(up, right)
        return math.atan2(float(level @ e1), float(level @ e0)), -math.copysign(math.pi / 2, rise), 0.0
    yaw, pitch = math.atan2(float(level @ e1), float(level @ e0)), -math.asin(rise)
    level_right, level_down, _ = rotation_of(up, yaw, pitch)
    roll = math.atan2(float(right @ level_down), float(right @ level_right))
    return yaw, pitch, 0.0 if abs(roll) < NO_ROLL else roll
