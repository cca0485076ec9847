"""The room of the sample for hundreds of frames: something moves all the time, and a parcel appears late."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from app.lab.synthetic.rigs import FOCUS, RING_HEIGHTS, RING_RADIUS, looking_at
from app.lab.synthetic.scene import SyntheticScene, make_parts, placed, still
from app.lab.synthetic.textures import Texture
from engine.camera.rig import CameraRig

MOTION_FRAMES = 18
"""Frames in which the ball flies 84 degrees round the room and the sculpture turns by 80: it takes 77 to come round."""
PARCEL_AT = 0.65
"""Share of the capture after which the parcel appears. Less than half of it is left, so the background is without."""
CONTRAST, PAINT = 0.4, np.array([0.56, 0.52, 0.47])
"""Share that is left of what textures differ from this colour. A small model shows such a room well, and seconds of
training suffice, while a wrong gain weighs as much as it did."""
ARC_DEG = 130.0
"""Part of the ring on which the cameras stand. A dozen are 12 degrees apart, near enough for depth to be found."""
FOCAL = 0.8
"""Focal length as a share of the width: 64 degrees across."""


def make_long_scene(
    *,
    size: tuple[int, int] = (160, 120),
    n_cameras: int = 12,
    n_frames: int = 300,
    clip_length: int = 10,
    fps: float = 30.0,
) -> SyntheticScene:
    """Room and furniture of the sample, cameras on an arc; the motion repeats, and the parcel appears inside a clip.

    Args:
        size: Image width and height of every camera.
        n_cameras: Cameras on the arc; two of them are held out where there are four or more.
        n_frames: Length of the capture.
        clip_length: Frames per clip of the training to come.
        fps: Frames per second.
    """
    frame_index = inside_clip(PARCEL_AT, n_frames=n_frames, clip_length=clip_length)
    parcel = still(placed(0.75, -0.7, 0.24, turn_deg=-20), from_frame=frame_index)
    parts = []
    for part in make_parts(clip_length=MOTION_FRAMES):
        pose = parcel if part.name == "gift" else part.pose
        texture = _whitened(part.texture) if part.name == "plinth" else _softened(part.texture)
        parts.append(replace(part, pose=pose, texture=texture))
    return SyntheticScene(tuple(parts), make_arc(n_cameras, size), n_frames, clip_length, fps)


def _softened(texture: Texture) -> Texture:
    return lambda points, normals: PAINT + CONTRAST * (texture(points, normals) - PAINT)


def _whitened(texture: Texture) -> Texture:
    """So white that exposures which rise are clipped there."""
    return lambda points, normals: np.sqrt(np.clip(texture(points, normals), 0, 1))


def make_arc(n_cameras: int, size: tuple[int, int]) -> CameraRig:
    """Alike cameras on a part of the sample's ring at its two heights, looking at the middle of the room.

    Args:
        n_cameras: Spread evenly over ARC_DEG.
        size: Image width and height.
    """
    width, height = size
    azimuths = np.radians(np.linspace(-0.5, 0.5, n_cameras) * ARC_DEG - 60.0)  # the pillar stands behind everything
    poses = []
    for i, azimuth in enumerate(azimuths):
        center = np.array([RING_RADIUS * np.cos(azimuth), RING_RADIUS * np.sin(azimuth), RING_HEIGHTS[i % 2]])
        poses.append(looking_at(center, FOCUS))
    K = np.array([[FOCAL * width, 0.0, width / 2], [0.0, FOCAL * width, height / 2], [0.0, 0.0, 1.0]])
    return CameraRig(
        names=tuple(f"cam{i:02d}" for i in range(n_cameras)),
        world_to_camera=np.round(np.stack(poses), 12),
        Ks=np.tile(K, (n_cameras, 1, 1)),
        image_sizes=np.tile(np.array(size, dtype=np.int64), (n_cameras, 1)),
    )


def inside_clip(share: float, *, n_frames: int, clip_length: int) -> int:
    """The frame in the middle of the clip that lies at this share of the capture."""
    return int(share * n_frames) // clip_length * clip_length + clip_length // 2
