"""OrbitView: where the user looks from. numpy only; OpenCV axes (x right, y down, z forward), scene units.

A free view orbits a pivot and stays upright; looking through a capture camera takes its pose and intrinsics instead.
"""

from __future__ import annotations

import math
from collections.abc import Hashable

import numpy as np

from engine.camera.rig import CameraRig

RADIANS_PER_PX = 0.006
MAX_PITCH = math.radians(89.0)
HOME_DISTANCE_SHARE = 0.9
"""Cameras of a dome can sit on the scene's own surface; the home view keeps a little inside of them."""


def rig_up(rig: CameraRig) -> np.ndarray:
    """The world direction that the cameras agree is up: the mean of their -y axes, unit length. [3]"""
    up = -rig.world_to_camera[:, 1, :3].mean(0)
    length = float(np.linalg.norm(up))
    return up / length if length > 1e-6 else np.array([0.0, -1.0, 0.0])


def _horizontal_axes(up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors that form a right-handed frame with `up`: e0 x e1 = up."""
    seed = np.eye(3)[int(np.argmin(np.abs(up)))]
    e0 = np.cross(seed, up)
    e0 /= np.linalg.norm(e0)
    return e0, np.cross(up, e0)


class OrbitView:
    """A camera on a sphere around a pivot.

    Attributes:
        pivot: What the free view looks at, scene units. [3]
        distance: From the eye to the pivot, scene units.
        yaw, pitch: Radians; a positive pitch looks down.
        fov_y: Vertical field of view of the free view, radians.
        up: Unit vector. [3]
        look_through: Index of a capture camera, or None.
    """

    def __init__(self, rig: CameraRig | None = None) -> None:
        self.rig = rig
        self.pivot = np.zeros(3)
        self.distance = 4.0
        self.yaw = 0.0
        self.pitch = 0.3
        self.fov_y = math.radians(50.0)
        self.up = np.array([0.0, -1.0, 0.0]) if rig is None else rig_up(rig)
        self.look_through: int | None = None
        self._height_px = 600
        if rig is not None:
            self.home()

    # ---------------------------------------------------------------- what it looks like

    @property
    def forward(self) -> np.ndarray:
        """Unit viewing direction of the free view. [3]"""
        e0, e1 = _horizontal_axes(self.up)
        level = math.cos(self.yaw) * e0 + math.sin(self.yaw) * e1
        return math.cos(self.pitch) * level - math.sin(self.pitch) * self.up

    @property
    def eye(self) -> np.ndarray:
        """Position of the free view, scene units. [3]"""
        return self.pivot - self.distance * self.forward

    def world_to_camera(self) -> np.ndarray:
        """Rigid map of the current view. [4, 4] float64"""
        if self.look_through is not None and self.rig is not None:
            return self.rig.world_to_camera[self.look_through].copy()
        forward = self.forward
        right = np.cross(forward, self.up)
        right /= np.linalg.norm(right)  # never zero: the pitch stays away from the pole
        rotation = np.stack([right, np.cross(forward, right), forward])
        matrix = np.eye(4)
        matrix[:3, :3] = rotation
        matrix[:3, 3] = -rotation @ self.eye
        return matrix

    def K(self, width: int, height: int) -> np.ndarray:
        """Intrinsics for a viewport of this size, pixel centres at +0.5. [3, 3] float64

        A capture camera's picture is fitted into the viewport and centred, so that nothing of it is cut off.
        """
        self._height_px = max(int(height), 1)
        if self.look_through is not None and self.rig is not None:
            image_width, image_height = (float(v) for v in self.rig.image_sizes[self.look_through])
            scale = min(width / image_width, height / image_height)
            K = self.rig.Ks[self.look_through].copy()
            K[:2] *= scale
            K[0, 2] += (width - scale * image_width) / 2
            K[1, 2] += (height - scale * image_height) / 2
            return K
        focal = height / (2.0 * math.tan(self.fov_y / 2.0))
        return np.array([[focal, 0.0, width / 2.0], [0.0, focal, height / 2.0], [0.0, 0.0, 1.0]])

    @property
    def look_key(self) -> Hashable:
        """Identity of where from and through which lens, whatever the size of the picture."""
        return self.look_through, self.fov_y, self.world_to_camera().tobytes()

    # ---------------------------------------------------------------- moving it

    def orbit(self, dx_px: float, dy_px: float) -> None:
        """Turn around the pivot as if the scene were dragged by that many pixels."""
        self.yaw = math.remainder(self.yaw + RADIANS_PER_PX * dx_px, 2 * math.pi)
        self.pitch = min(max(self.pitch + RADIANS_PER_PX * dy_px, -MAX_PITCH), MAX_PITCH)

    def pan(self, dx_px: float, dy_px: float) -> None:
        """Move sideways; what lies at the pivot's depth follows the pointer."""
        units_per_px = 2.0 * self.distance * math.tan(self.fov_y / 2.0) / self._height_px
        right, down, _ = self._free_axes()
        self.pivot = self.pivot - units_per_px * (dx_px * right + dy_px * down)

    def dolly(self, factor: float) -> None:
        """Multiply the distance to the pivot; below 1 moves nearer."""
        if math.isfinite(factor) and factor > 0:
            self.distance = min(max(self.distance * factor, 1e-4), 1e6)

    def home(self) -> None:
        """Frame the point that the cameras look at, from where a level, central camera stands."""
        self.look_through = None
        if self.rig is None or len(self.rig) == 0:
            return
        focus = self.rig.focus_point()
        camera = _home_camera(self.rig, focus, self.up)
        offset = focus - self.rig.centers[camera]
        distance = float(np.linalg.norm(offset))
        self._aim(offset / distance if distance > 1e-9 else self.rig.forwards[camera])
        self.pivot = focus
        self.distance = max(HOME_DISTANCE_SHARE * distance, 1e-3)
        self.fov_y = self._camera_fov(camera)

    def look(self, camera_index: int | None) -> None:
        """Look through a capture camera; None goes on freely from where that camera stands.

        Raises:
            ValueError: There is no such camera.
        """
        if camera_index is not None and not (self.rig is not None and 0 <= camera_index < len(self.rig)):
            raise ValueError(f"there is no camera {camera_index}")
        if camera_index is None and self.look_through is not None and self.rig is not None:
            camera = self.look_through
            eye, forward = self.rig.centers[camera], self.rig.forwards[camera]
            self._aim(forward)
            ahead = float((self.rig.focus_point() - eye) @ forward)
            self.distance = ahead if ahead > 1e-3 else self.distance
            self.pivot = eye + self.distance * self.forward
            self.fov_y = self._camera_fov(camera)
        self.look_through = camera_index

    def _aim(self, forward: np.ndarray) -> None:
        e0, e1 = _horizontal_axes(self.up)
        self.pitch = min(max(-math.asin(float(np.clip(forward @ self.up, -1.0, 1.0))), -MAX_PITCH), MAX_PITCH)
        self.yaw = math.atan2(float(forward @ e1), float(forward @ e0))

    def _camera_fov(self, camera: int) -> float:
        assert self.rig is not None
        height, focal = float(self.rig.image_sizes[camera, 1]), float(self.rig.Ks[camera, 1, 1])
        return 2.0 * math.atan(height / (2.0 * focal))

    def _free_axes(self) -> np.ndarray:
        forward = self.forward
        right = np.cross(forward, self.up)
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(forward, right), forward])


def _home_camera(rig: CameraRig, focus: np.ndarray, up: np.ndarray) -> int:
    """A camera that looks level and stands in the middle of the others.

    A dome's mean direction points straight up; only its level part counts, so that the home view is not from above.
    """
    offsets = rig.centers - focus
    directions = offsets / np.maximum(np.linalg.norm(offsets, axis=1, keepdims=True), 1e-9)
    heights = directions @ up
    level_mean = directions.mean(0) - heights.mean() * up
    return int(np.argmax(directions @ level_mean - 0.5 * np.abs(heights)))
