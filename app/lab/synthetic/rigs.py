"""Rigs of cameras for the generated scene: a ring, a wall of cameras that all look one way, and half a dome.

No two cameras of a rig have the same intrinsics, none looks exactly at the same point, and none stands quite upright.
"""

from __future__ import annotations

import numpy as np

from engine.camera.rig import CameraRig

RING_RADIUS = 2.7
"""Distance of the cameras from the middle of the room."""
RING_HEIGHTS = (1.05, 1.85)
"""Neighbouring cameras alternate between these."""
FOCUS = np.array([0.0, 0.0, 0.62])
"""The point that the cameras look at, give or take some centimetres."""
FORWARD_WIDTH = 3.2
"""Width of a forward-facing rig, from the leftmost to the rightmost camera."""
FORWARD_DISTANCE = 2.7
"""Distance of a forward-facing rig from the middle of the room."""
FORWARD_FOCUS = np.array([0.0, 0.9, 0.8])
"""The point that forward-facing cameras look at: behind the middle, so that their axes are not far from parallel."""
DOME_RADIUS = 2.4
"""Distance of the lowest cameras of the half dome from the middle of the room."""
DOME_HEIGHTS = (0.55, 2.55)
"""Heights of the lowest and of the highest camera of the half dome."""


def make_rig(n_cameras: int, size: tuple[int, int]) -> CameraRig:
    """Cameras on a ring at two heights, looking inwards.

    Args:
        n_cameras: Spread evenly round the room.
        size: Image width and height.
    """
    azimuths = 2 * np.pi * (np.arange(n_cameras) + 0.5) / n_cameras
    heights = np.resize(RING_HEIGHTS, n_cameras)
    return rig_at(np.column_stack([RING_RADIUS * np.cos(azimuths), RING_RADIUS * np.sin(azimuths), heights]), size)


def forward_facing_rig(n_cameras: int, size: tuple[int, int]) -> CameraRig:
    """Two rows of cameras, one over the other, that look the same way; the lower row comes first.

    Args:
        n_cameras: At least 2.
        size: Image width and height.
    """
    n_lower = (n_cameras + 1) // 2
    rows = [(n_lower, RING_HEIGHTS[0]), (n_cameras - n_lower, RING_HEIGHTS[1])]
    across = np.concatenate([FORWARD_WIDTH * ((np.arange(n) + 0.5) / n - 0.5) for n, _ in rows if n])
    heights = np.concatenate([np.full(n, height) for n, height in rows])
    centers = np.column_stack([across, np.full(n_cameras, -FORWARD_DISTANCE), heights])
    return rig_at(centers, size, target=FORWARD_FOCUS)


def half_dome_rig(n_cameras: int, size: tuple[int, int]) -> CameraRig:
    """Cameras spread evenly over the upper half of a dome, from knee height to almost overhead.

    Args:
        n_cameras: At least 1.
        size: Image width and height.
    """
    rise = np.sin(np.radians(72.0)) * (np.arange(n_cameras) + 0.5) / n_cameras  # even heights are even areas
    azimuths = np.arange(n_cameras) * np.pi * (3 - np.sqrt(5))
    reach = DOME_RADIUS * np.sqrt(1 - rise**2)
    heights = DOME_HEIGHTS[0] + (DOME_HEIGHTS[1] - DOME_HEIGHTS[0]) * rise
    return rig_at(np.column_stack([reach * np.cos(azimuths), reach * np.sin(azimuths), heights]), size)


def rig_at(centers: np.ndarray, size: tuple[int, int], *, target: np.ndarray = FOCUS) -> CameraRig:
    """Cameras at these places that look at one point.

    Args:
        centers: [C, 3] scene units, none straight above or below the target.
        size: Image width and height.
        target: The point that they look at, give or take some centimetres. [3]
    """
    width, height = size
    generator = np.random.default_rng(20)
    poses, Ks = [], []
    for center in centers:
        own_target = target + generator.uniform(-0.06, 0.06, 3)
        poses.append(looking_at(center, own_target, roll_deg=float(generator.uniform(-1.5, 1.5))))
        focal = width * generator.uniform(0.745, 0.825)  # 62 to 68 degrees across
        offset = generator.uniform(-0.018, 0.018, 2) * width  # up to 5.8 px at 320
        fx, fy = focal, focal * generator.uniform(0.996, 1.004)
        Ks.append([[fx, 0.0, width / 2 + offset[0]], [0.0, fy, height / 2 + offset[1]], [0.0, 0.0, 1.0]])
    return CameraRig(
        names=tuple(f"cam{i:02d}" for i in range(len(centers))),
        world_to_camera=np.round(np.stack(poses), 12),
        Ks=np.round(np.array(Ks), 6),
        image_sizes=np.tile(np.array(size, dtype=np.int64), (len(centers), 1)),
    )


def looking_at(center: np.ndarray, target: np.ndarray, *, roll_deg: float = 0.0) -> np.ndarray:
    """world_to_camera of a camera at `center` that looks at `target` with z up. [4, 4], OpenCV axes"""
    forward = (target - center) / np.linalg.norm(target - center)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    roll = np.radians(roll_deg)
    rotation = np.stack(
        [np.cos(roll) * right + np.sin(roll) * down, np.cos(roll) * down - np.sin(roll) * right, forward]
    )
    world_to_camera = np.eye(4)
    world_to_camera[:3, :3] = rotation
    world_to_camera[:3, 3] = -rotation @ center
    return world_to_camera
