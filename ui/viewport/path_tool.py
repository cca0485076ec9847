"""Editing of a camera path's keys by pointer and keyboard. State of the window; no ImGui, no GL."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from app.session.paths.path_commands import PlaceCameraKey
from engine.camera.camera_path import CameraKey
from engine.camera.projection import to_camera

NUDGE_SHARE = 0.02
"""A press of a key moves a camera key by this share of its distance from the eye."""
DEPTH_PER_PX = 0.01
"""Along the viewing direction a drag of one pixel moves it by this share of its distance."""
TOGETHER_S = 1.0
"""Presses of keys that follow each other within this time are one step back."""


@dataclass(eq=False)
class PathTool:
    """The drag or the presses in progress.

    Attributes:
        gesture: Number of the present one; see app.session.paths.path_commands.
        dragged: Number of the key that is dragged in a picture; None while none is.
        timed: Number of the key that is pressed on the timeline; None while none is.
        timed_from: Where it was pressed, units of the screen; None once that has become a drag.
        renamed: The name that is being written; None while it is that of the path.
    """

    gesture: int = 0
    dragged: int | None = None
    timed: int | None = None
    timed_from: float | None = None
    renamed: str | None = None
    _pressed_s: float = -1e9

    def begin_gesture(self) -> int:
        """Start something that is taken back at once. Returns its number."""
        self.gesture += 1
        return self.gesture

    def press_gesture(self) -> int:
        """A key was pressed: part of the presses before, if they were a moment ago."""
        now_s = time.monotonic()
        if now_s - self._pressed_s > TOGETHER_S:
            self.begin_gesture()
        self._pressed_s = now_s
        return self.gesture


def moved_in_view(
    index: int,
    key: CameraKey,
    world_to_camera: np.ndarray,
    K: np.ndarray,
    dx_px: float,
    dy_px: float,
    *,
    is_along_view: bool,
    gesture: int,
) -> PlaceCameraKey | None:
    """The command that moves a key as a drag over a picture does; None where it lies behind the view.

    Args:
        world_to_camera: Of the view. [4, 4]
        K: Of the picture in which dx_px and dy_px are pixels. [3, 3]
        is_along_view: Upwards is farther away; else it follows the pointer, as far away as it is.
    """
    depth = float(to_camera(key.center, world_to_camera)[2])
    if depth <= 0.0:
        return None
    if is_along_view:
        step = np.array([0.0, 0.0, -DEPTH_PER_PX * dy_px * depth])
    else:
        step = np.array([dx_px * depth / K[0, 0], dy_px * depth / K[1, 1], 0.0])
    return _place(index, key, key.center + step @ world_to_camera[:3, :3], gesture)


def nudged(
    index: int, key: CameraKey, rotation: np.ndarray, eye: np.ndarray, direction: np.ndarray, *, gesture: int
) -> PlaceCameraKey:
    """The command that moves a key by one press of a key.

    Args:
        rotation: Right, down and forward directions of the view as rows. [3, 3]
        eye: Where the view seems to stand, scene units. [3]
        direction: Steps to the right, down and forward. [3]
    """
    step = NUDGE_SHARE * max(float(np.linalg.norm(key.center - eye)), 1e-6)
    return _place(index, key, key.center + step * (np.asarray(direction, dtype=np.float64) @ rotation), gesture)


def _place(index: int, key: CameraKey, center: np.ndarray, gesture: int) -> PlaceCameraKey:
    return PlaceCameraKey(index, (float(center[0]), float(center[1]), float(center[2])), gesture)
