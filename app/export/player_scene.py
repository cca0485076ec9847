"""A player's facts about a scene other than its Gaussians: time, cameras, where one looks from at first, and what is
seen from there."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from app.playback.modes.arrays import BACKGROUND
from app.playback.views.orbit_view import OrbitView
from app.playback.views.rig_views import camera_pose, home_camera

if TYPE_CHECKING:
    from app.export.scene_frames import SceneFrames
    from app.export.take import TakeFrame
    from engine.camera.rig import CameraRig

POSTER_SIZE = (640, 360)
"""Pixels."""
POSTER_QUALITY = 70


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


def poster(scene: SceneFrames, shown: TakeFrame) -> bytes:
    """A JPEG of POSTER_SIZE of the first view. Raises ProjectError as `SceneFrames.gaussians`."""
    from app.export.video.drawing import draw
    from app.export.video.views import ViewPoint

    width, height = POSTER_SIZE
    view = OrbitView(scene.opened.rig)
    focal = height / (2.0 * np.tan(view.fov_y / 2.0))
    K = np.array([[focal, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]])
    drawn = draw(scene, shown.moments, ViewPoint(view.world_to_camera(), K, width, height))
    picture = drawn.color + (1.0 - drawn.alpha[..., None]) * np.array(BACKGROUND, np.float32)
    stream = io.BytesIO()
    Image.fromarray(np.round(255.0 * np.clip(picture, 0.0, 1.0)).astype(np.uint8)).save(
        stream, "JPEG", quality=POSTER_QUALITY, optimize=True, progressive=True
    )
    return stream.getvalue()


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
