"""From where pictures are taken: a camera of the capture, a path of the project, or a turntable."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app.export.jobs.video import Turntable
from app.playback.views.rig_views import camera_fov, fitted_K, home_camera
from app.playback.views.scene_axes import rig_radius
from engine.camera import path_presets
from engine.camera.camera_path import CameraPath
from engine.camera.projection import pinhole_K
from engine.camera.rig import CameraRig


@dataclass(frozen=True, slots=True, eq=False)
class ViewPoint:
    """A camera as pictures are drawn from it.

    Attributes:
        world_to_camera: OpenCV axes, scene units. [4, 4]
        K: Intrinsics, pixels, for pictures of `width` x `height`. [3, 3]
        camera_index: The capture camera that is looked through, whose colours pictures have; None for the scene's own.
    """

    world_to_camera: np.ndarray
    K: np.ndarray
    width: int
    height: int
    camera_index: int | None = None

    def is_same(self, other: ViewPoint) -> bool:
        """Whether pictures from both are the same."""
        sizes = (self.width, self.height, self.camera_index) == (other.width, other.height, other.camera_index)
        return sizes and np.array_equal(self.world_to_camera, other.world_to_camera) and np.array_equal(self.K, other.K)


ViewOf = Callable[[int, float], ViewPoint]
"""From where a picture is taken: its number in the video, and its moment in frames of the capture."""


def camera_view(rig: CameraRig, camera_index: int, size: tuple[int, int] | None) -> ViewOf:
    """A camera that stands still; its picture is fitted into another size."""
    width, height = (int(side) for side in rig.image_sizes[camera_index]) if size is None else size
    K = rig.Ks[camera_index] if size is None else fitted_K(rig, camera_index, width, height)
    view = ViewPoint(rig.world_to_camera[camera_index], K, width, height, camera_index)
    return lambda picture, moment: view


def path_view(path: CameraPath, size: tuple[int, int]) -> ViewOf:
    """A camera on a path, whose keys are moments of the capture."""

    def view(picture: int, moment: float) -> ViewPoint:
        world_to_camera, fov_y_rad = path.at(moment)
        return ViewPoint(world_to_camera, pinhole_K(fov_y_rad, size), *size)

    return view


def turntable_view(
    rig: CameraRig, up: np.ndarray, turntable: Turntable, n_pictures: int, size: tuple[int, int]
) -> ViewOf:
    """A circle around what the cameras look at, beginning in front of the camera that the home view begins at, through
    a lens like that camera's. up: The scene's upward direction. [3]"""
    focus = rig.focus_point()
    camera = home_camera(rig, focus, up)
    path = path_presets.turntable(
        focus,
        up,
        rig_radius(rig) if turntable.radius is None else turntable.radius,
        math.radians(turntable.elevation_deg),
        (0.0, float(n_pictures)),
        turntable.n_turns,
        fov_y_rad=camera_fov(rig, camera),
        start=rig.centers[camera] - focus,
    )
    along = path_view(path, size)
    return lambda picture, moment: along(picture, picture)
