"""A player's facts about a scene other than its Gaussians: time, cameras, and where one looks from at first."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from app.playback.modes.arrays import BACKGROUND
from app.playback.views.orbit_view import OrbitView
from app.playback.views.rig_views import camera_pose, home_camera

if TYPE_CHECKING:
    from app.export.scene_frames import SceneFrames
    from engine.camera.rig import CameraRig


def scene_header(scene: SceneFrames, frame: float, *, step: int) -> dict[str, Any]:
    """The page's header without its blocks; see docs/player_format.md. The list of clips is empty.

    Args:
        frame: One that is trained.
        step: Frames of the capture from one frame of the player to the next.
    """
    capture, reference = scene.opened.capture, scene.opened.reference
    base = scene.opened.header(scene.clip_at(frame).clip_index) if reference is None else reference.header
    rig = scene.opened.rig
    view = OrbitView(rig)
    home = home_camera(rig, rig.focus_point(), view.up)
    width, height = (int(v) for v in rig.image_sizes[home])
    return {
        "title": capture.path.name or "ClipGStream",
        "fps": float(capture.fps),
        "step": step,
        "near_plane": float(base.near_plane),
        "background": [round(float(v), 6) for v in BACKGROUND],
        "up": _numbers(view.up),
        "radius": float(view.radius),
        "home": {
            "world_to_camera": _numbers(view.world_to_camera()),
            "distance": float(view.distance),
            "fov_y": float(view.fov_y),
            "aspect": width / height,
        },
        "cameras": [_camera(rig, index, view.distance) for index in range(len(rig))],
        "take": None,
        "clips": [],
    }


def _camera(rig: CameraRig, index: int, otherwise: float) -> dict[str, Any]:
    K = rig.Ks[index]
    width, height = (int(v) for v in rig.image_sizes[index])
    return {
        "name": rig.names[index],
        "width": width,
        "height": height,
        "K": [float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2])],
        "world_to_camera": _numbers(rig.world_to_camera[index]),
        "distance": float(camera_pose(rig, index, otherwise=otherwise).distance),
    }


def _numbers(values: np.ndarray) -> list[float]:
    return [float(value) for value in np.asarray(values).ravel()]
