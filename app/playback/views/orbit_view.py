"""OrbitView: where the user looks from. numpy only; OpenCV axes (x right, y down, z forward), scene units.

A free view orbits a pivot; looking through a capture camera takes its pose and intrinsics instead. The set pose is the
target of a move; the shown pose may be on the way there (app.playback.views.view_motion).

An orthographic view is drawn from very far away through a very long lens, because rasterizers know pinhole cameras
only: see FLAT_SHARE.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from app.playback.views.rig_views import camera_fov, camera_pose, fitted_K, free_pose, home_camera
from app.playback.views.scene_axes import RIG_UP, UP_AXES, axis_rotation, horizontal_axes, rig_radius
from app.playback.views.view_angles import angles_of, rotation_of
from app.playback.views.view_motion import Pose, ViewMotion, between, blended
from engine.camera.rig import CameraRig

RADIANS_PER_PX = 0.006
MAX_PITCH = math.radians(89.0)
"""Dragging stops here; a view along the upright axis is exactly at a right angle."""
HOME_DISTANCE_SHARE = 0.9
"""Cameras of a dome can sit on the scene's own surface; the home view keeps a little inside of them."""
MIN_FOV_Y, MAX_FOV_Y = math.radians(5.0), math.radians(140.0)
FLAT_SHARE = 10_000.0
"""An orthographic view stands this many scene radii away. At the corner of a 1280 x 720 picture a point one radius
before or behind the pivot is then 0.08 px from where it belongs. Depths are float32 in the rasterizers and come in
steps of a thousandth of a radius: enough to draw, not to sort, so renderers sort by depth within the scene."""
FLAT_REACH = 0.9
"""An orthographic view is cut off this many scene radii before the pivot, where the cameras stand: a wall behind them
would hide everything. Farther away where one has moved away farther."""
FRAME_SHARE = 1.15
"""A framed subject leaves a little room at the edge."""


class OrbitView:
    """A camera on a sphere around a pivot.

    Attributes:
        pivot: The point that the free view looks at, scene units. [3]
        distance: From where it seems to stand to the pivot, scene units.
        yaw, pitch, roll: Radians; a positive pitch looks down, a positive roll leans to the right.
        fov_y: Vertical field of view of the free view, radians.
        is_orthographic: Whether parallel lines stay parallel in the free view.
        up_axis: One of UP_AXES.
        up: Unit vector. [3]
        scene_up: The scene's upward direction as set by the user, instead of the one that the cameras agree on. [3]
        look_through: Index of a capture camera, or None.
        is_eased: Whether jumps are shown as short moves.
        radius: Of the scene, scene units.
    """

    def __init__(self, rig: CameraRig | None = None) -> None:
        self.rig = rig
        self.pivot = np.zeros(3)
        self.distance = 4.0
        self.yaw = 0.0
        self.pitch = 0.3
        self.roll = 0.0
        self.fov_y = math.radians(50.0)
        self.is_orthographic = False
        self.up_axis = RIG_UP
        self.scene_up: np.ndarray | None = None
        self.up = np.array([0.0, -1.0, 0.0]) if rig is None else rig.up_direction()
        self.look_through: int | None = None
        self.is_eased = False
        self.radius = 1.0 if rig is None or len(rig) == 0 else max(rig_radius(rig), 1e-6)
        self._motion: ViewMotion | None = None
        self._size_px = (800, 600)
        if rig is not None:
            self.home()

    # ---------------------------------------------------------------- pose and lens

    @property
    def rotation(self) -> np.ndarray:
        """Right, down and forward directions of the free view as rows. [3, 3]"""
        return rotation_of(self.up, self.yaw, self.pitch, self.roll)

    @property
    def forward(self) -> np.ndarray:
        """Unit viewing direction of the free view. [3]"""
        return self.rotation[2]

    @property
    def eye(self) -> np.ndarray:
        """Place where the free view seems to stand, scene units. [3]"""
        return self.pivot - self.distance * self.forward

    def pose(self) -> Pose:
        """The pose that the view is moving to, which may not be shown yet."""
        if self.look_through is not None and self.rig is not None:
            return camera_pose(self.rig, self.look_through, otherwise=self.distance)
        eye_distance = max(FLAT_SHARE * self.radius, self.distance) if self.is_orthographic else self.distance
        return Pose(self.rotation, self.pivot, self.distance, eye_distance, self.fov_y)

    @property
    def shown_pose(self) -> Pose:
        """The pose that is shown, on the way to where the view is going."""
        pose = self.pose()
        return pose if self._motion is None else blended(self._motion.start, pose, self._motion.share)

    @property
    def is_moving(self) -> bool:
        """Whether the shown pose is still on its way."""
        return self._motion is not None

    def world_to_camera(self) -> np.ndarray:
        """Rigid map of the shown pose. [4, 4] float64"""
        if self._motion is None and self.look_through is not None and self.rig is not None:
            return self.rig.world_to_camera[self.look_through].copy()
        return self.shown_pose.world_to_camera()

    def K(self, width: int, height: int) -> np.ndarray:
        """Intrinsics for a viewport of this size, pixel centres at +0.5. [3, 3] float64

        A capture camera's picture is fitted into the viewport and centred, so that nothing of it is cut off.
        """
        self._size_px = (max(int(width), 1), max(int(height), 1))
        return self._shown_K(width, height)

    @property
    def set_back(self) -> float:
        """How much farther away the camera of `world_to_camera` stands than it seems to, scene units: 0 but for an
        orthographic view."""
        pose = self.shown_pose
        return max(pose.eye_distance - pose.distance, 0.0)

    @property
    def near(self) -> float:
        """Nothing nearer to the camera of `world_to_camera` than this is to be drawn, scene units; 0 where the scene
        alone decides. Above 0 only for an orthographic view, whose camera stands far away."""
        pose = self.shown_pose
        if pose.eye_distance <= pose.distance:
            return 0.0
        return max(pose.eye_distance - max(pose.distance, FLAT_REACH * self.radius), 0.0)

    @property
    def look_key(self) -> Hashable:
        """Identity of the viewpoint and lens, regardless of the size of the picture."""
        return self.look_through, self._shown_K(1000, 1000).tobytes(), self.world_to_camera().tobytes()

    def advance(self, dt_s: float) -> bool:
        """Let a move continue. Whether it still does."""
        if self._motion is not None:
            self._motion = self._motion.advanced(dt_s)
        return self._motion is not None

    def stop(self) -> None:
        """Stay where the move has come to; a view that was on its way to a camera, or from one, is free then."""
        if self._motion is not None:
            self._stay(self.shown_pose)
            self._motion, self.look_through = None, None

    # ---------------------------------------------------------------- moving it

    def orbit(self, dx_px: float, dy_px: float, about: np.ndarray | None = None) -> None:
        """Turn around a point as if the scene were dragged by that many pixels; the point stays where it is seen.

        Args:
            about: Scene units; the pivot when None. [3]
        """
        if not _are_finite(dx_px, dy_px):
            return
        self.stop()
        center = self.pivot if about is None or not np.isfinite(about).all() else about
        before = self.rotation @ (self.pivot - center)
        self._turn(RADIANS_PER_PX * dx_px, RADIANS_PER_PX * dy_px)
        if center is not self.pivot:
            self.pivot = center + self.rotation.T @ before

    def look_around(self, dx_px: float, dy_px: float) -> None:
        """Turn on the spot: things to the right come into view where the pointer moves to the right."""
        if not _are_finite(dx_px, dy_px):
            return
        self.stop()
        eye, per_px = self.eye, self.fov_y / self._size_px[1]
        self._turn(-per_px * dx_px, per_px * dy_px)
        self.pivot = eye + self.distance * self.forward

    def lean(self, radians: float) -> None:
        """Roll about the viewing direction; positive leans to the right."""
        if _are_finite(radians):
            self.stop()
            self.roll = math.remainder(self.roll + radians, 2 * math.pi)

    def pan(self, dx_px: float, dy_px: float) -> None:
        """Move sideways; things at the pivot's depth follow the pointer."""
        if not _are_finite(dx_px, dy_px):
            return
        self.stop()
        units_per_px = 2.0 * self.distance * math.tan(self.fov_y / 2.0) / self._size_px[1]
        right, down, _ = self.rotation
        self.pivot = self.pivot - units_per_px * (dx_px * right + dy_px * down)

    def dolly(self, factor: float, toward: np.ndarray | None = None) -> None:
        """Multiply the distance to a point; below 1 moves nearer. The point stays where it is seen.

        Args:
            toward: Scene units; the pivot when None. [3]
        """
        if not (_are_finite(factor) and factor > 0):
            return
        self.stop()
        distance = min(max(self.distance * factor, 1e-4), 1e6)
        if toward is not None and np.isfinite(toward).all():
            self.pivot = toward + distance / self.distance * (self.pivot - toward)
        self.distance = distance

    def fly(self, right: float, up: float, forward: float) -> None:
        """Move eye and pivot together: to the right, upwards in the world, and ahead. Scene units"""
        if not _are_finite(right, up, forward):
            return
        self.stop()
        axes = self.rotation
        if self.is_orthographic:  # nothing comes nearer in a view without perspective
            self.dolly(math.exp(-forward / self.radius))
            forward = 0.0
        self.pivot = self.pivot + right * axes[0] + up * self.up + forward * axes[2]

    def set_fov(self, fov_y: float) -> None:
        """Take another lens, from the same place. Radians; held within MIN_FOV_Y and MAX_FOV_Y"""
        if _are_finite(fov_y):
            self.stop()
            self.fov_y = min(max(fov_y, MIN_FOV_Y), MAX_FOV_Y)

    def take_pivot(self, point: np.ndarray) -> None:
        """Turn and move about a pivot as far away as a point. The picture does not change. Scene units, [3]"""
        if not np.isfinite(point).all():
            return
        self.stop()
        depth = float((point - self.pivot) @ self.forward)
        if self.is_orthographic:
            self.pivot = self.pivot + depth * self.forward
        elif self.distance + depth > 1e-4:
            self.distance += depth
            self.pivot = self.pivot + depth * self.forward

    # ---------------------------------------------------------------- jumps, which may be eased

    def home(self) -> None:
        """Frame the point that the cameras look at, from where a level, central camera stands."""
        with self.jump():
            self.look_through, self.roll = None, 0.0
            if self.rig is None or len(self.rig) == 0:
                return
            focus = self.rig.focus_point()
            camera = home_camera(self.rig, focus, self.up)
            offset = focus - self.rig.centers[camera]
            distance = float(np.linalg.norm(offset))
            self._aim(offset / distance if distance > 1e-9 else self.rig.forwards[camera])
            self.pivot = focus
            self.distance = max(HOME_DISTANCE_SHARE * distance, 1e-3)
            self.fov_y = camera_fov(self.rig, camera)

    def look(self, camera_index: int | None) -> None:
        """Look through a capture camera; None continues freely from where that camera stands.

        Raises:
            ValueError: There is no such camera.
        """
        if camera_index is not None and not (self.rig is not None and 0 <= camera_index < len(self.rig)):
            raise ValueError(f"there is no camera {camera_index}")
        with self.jump():
            self._leave()
            self.look_through = camera_index

    def stand(self, world_to_camera: np.ndarray, fov_y: float, *, is_jump: bool = False) -> None:
        """Stand freely where a camera stands, turned as it is; the pivot lies ahead of it as far away as the scene.

        Args:
            world_to_camera: Rigid map. [4, 4]
            fov_y: Vertical field of view, radians.
            is_jump: Show the way there as other jumps; else be there at once.
        """
        pose = free_pose(self.rig, world_to_camera, fov_y, otherwise=self.distance)
        with self.jump():
            self.look_through, self.is_orthographic = None, False
            self._stay(pose)
        if not is_jump:
            self._motion = None

    def look_along(self, name: str) -> None:
        """Look at the pivot along an axis, see app.playback.views.scene_axes.AXIS_VIEWS.

        Raises:
            ValueError: There is no such view.
        """
        rotation = axis_rotation(self.up, name)
        with self.jump():
            self._leave()
            self._take_rotation(rotation)

    def frame(self, center: np.ndarray, radius: float) -> None:
        """Look at a sphere from the same side, so that it fills the picture. Scene units, [3]"""
        if not (np.isfinite(center).all() and _are_finite(radius)):
            return
        with self.jump():
            self._leave()
            width, height = self._size_px
            half = math.atan(math.tan(self.fov_y / 2.0) * min(width / height, 1.0))
            self.pivot = np.asarray(center, dtype=np.float64).copy()
            self.distance = max(FRAME_SHARE * radius / math.sin(half), 1e-4)

    def focus_on(self, point: np.ndarray) -> None:
        """Bring a point into the middle, as large as it is. Scene units, [3]"""
        if not np.isfinite(point).all():
            return
        with self.jump():
            self._leave()
            if not self.is_orthographic:
                depth = float((point - self.eye) @ self.forward)
                self.distance = depth if depth > 1e-4 else self.distance
            self.pivot = np.asarray(point, dtype=np.float64).copy()

    def stand_upright(self) -> None:
        """Take back all rolling."""
        with self.jump():
            self._leave()
            self.roll = 0.0

    def set_orthographic(self, is_on: bool) -> None:
        """Drop or take up perspective; things at the pivot keep their size."""
        with self.jump():
            self._leave()
            self.is_orthographic = is_on

    def set_up_axis(self, name: str) -> None:
        """Choose what is up; the view looks in the same direction from the same place, and stands upright.

        Raises:
            ValueError: There is no such axis.
        """
        if name not in UP_AXES:
            raise ValueError(f"up can be {', '.join(UP_AXES)}, not {name!r}")
        with self.jump():
            forward = self.forward
            axis = UP_AXES[name]
            self.up_axis = name
            if axis is not None:
                self.up = np.array(axis)
            elif self.scene_up is not None:
                self.up = self.scene_up.copy()
            else:
                self.up = np.array([0.0, -1.0, 0.0]) if self.rig is None else self.rig.up_direction()
            self._aim(forward)
            self.roll = 0.0

    def set_scene_up(self, up: Sequence[float] | None) -> None:
        """Set the scene's up direction; None for the one that the cameras agree on. A view that stands as the scene
        does follows."""
        known = None if self.scene_up is None else self.scene_up.tolist()
        if known == (None if up is None else list(up)):
            return
        self.scene_up = None if up is None else np.array(up, dtype=np.float64)
        if self.up_axis == RIG_UP:
            self.set_up_axis(RIG_UP)

    @contextmanager
    def jump(self) -> Iterator[None]:
        """Changes in here are shown as a move, from the pose shown now. Jumps inside of a jump are part of it."""
        start = ViewMotion(self.shown_pose, None if self._motion else self.look_through)
        yield
        self._motion = start if self.is_eased else None

    # ---------------------------------------------------------------- arithmetic

    def _shown_K(self, width: int, height: int) -> np.ndarray:
        K = self._K_of(self.pose(), self.look_through, width, height)
        if self._motion is None:
            return K
        start = self._K_of(self._motion.start, self._motion.camera, width, height)
        share = self._motion.share
        shown = (1.0 - share) * start + share * K
        for axis in (0, 1):
            shown[axis, axis] = between(start[axis, axis], K[axis, axis], share)
        return shown

    def _K_of(self, pose: Pose, camera: int | None, width: int, height: int) -> np.ndarray:
        if camera is not None and self.rig is not None:
            return fitted_K(self.rig, camera, width, height)
        focal = pose.focal_px(height)
        return np.array([[focal, 0.0, width / 2.0], [0.0, focal, height / 2.0], [0.0, 0.0, 1.0]])

    def _leave(self) -> None:
        """Continue freely from the pose of the camera that is looked through."""
        if self.look_through is not None and self.rig is not None:
            self._stay(camera_pose(self.rig, self.look_through, otherwise=self.distance))
            self.is_orthographic = False
        self.look_through = None

    def _stay(self, pose: Pose) -> None:
        self.pivot, self.distance = pose.pivot.copy(), pose.distance
        self.fov_y = pose.fov_y
        self._take_rotation(pose.rotation)

    def _turn(self, to_left: float, down: float) -> None:
        """Change yaw and pitch by angles along the picture's axes."""
        cos, sin = math.cos(self.roll), math.sin(self.roll)
        to_left, down = cos * to_left - sin * down, sin * to_left + cos * down
        self.yaw = math.remainder(self.yaw + to_left, 2 * math.pi)
        limit = max(MAX_PITCH, abs(self.pitch))
        self.pitch = min(max(self.pitch + down, -limit), limit)

    def _aim(self, forward: np.ndarray) -> None:
        e0, e1 = horizontal_axes(self.up)
        self.pitch = min(max(-math.asin(float(np.clip(forward @ self.up, -1.0, 1.0))), -MAX_PITCH), MAX_PITCH)
        self.yaw = math.atan2(float(forward @ e1), float(forward @ e0))

    def _take_rotation(self, rotation: np.ndarray) -> None:
        self.yaw, self.pitch, self.roll = angles_of(self.up, rotation)


def _are_finite(*values: float) -> bool:
    return all(math.isfinite(value) for value in values)
