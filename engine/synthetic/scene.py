"""The sample scene: a furnished room with parts that stand, turn, fly and appear, and the cameras around it.

World: right-handed, z up, scene units are metres, the floor at z = 0. Nothing is rendered here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from engine.camera.rig import CameraRig
from engine.synthetic import meshes, textures
from engine.synthetic.meshes import Mesh
from engine.synthetic.textures import Texture

ROOM_SIZE = (6.0, 6.0, 2.8)
"""Inner width, depth and height."""
LIGHT_POSITION = np.array([0.5, -0.7, 2.6])
"""Centre of the lamp."""
LIGHT_RADIUS = 0.45
"""The lamp is a level disc of this radius, which makes shadows soft."""
SAMPLE_CAMERAS = 20
"""18 degrees apart: with 12 (30 degrees) a third of the floor finds no match and depth is off by 28 cm at the third
quartile; with 20 by 10 cm."""
RING_RADIUS = 2.7
"""Distance of the cameras from the middle of the room."""
RING_HEIGHTS = (1.05, 1.85)
"""Neighbouring cameras alternate between these."""
FOCUS = np.array([0.0, 0.0, 0.62])
"""What the cameras look at, give or take some centimetres."""
DEGREES_PER_CLIP_BALL = 84.0
"""Way of the ball round the room in one clip: a chord of 1.2 units, a third of a view."""
DEGREES_PER_CLIP_SCULPTURE = 80.0
"""Turn of the sculpture in one clip."""


@dataclass(frozen=True, slots=True)
class Part:
    """One object of the scene.

    Attributes:
        name: Key of its mask.
        mesh: In object space.
        texture: Albedo over object space.
        pose: frame_index -> object-to-world map [4, 4], or None while the part is not in the scene.
        is_moving: Whether its pose changes while it is there.
    """

    name: str
    mesh: Mesh
    texture: Texture
    pose: Callable[[int], np.ndarray | None]
    is_moving: bool = False


@dataclass(frozen=True, slots=True)
class SyntheticScene:
    """Parts over time and the cameras that see them.

    Attributes:
        parts: All objects, the room first.
        rig: The cameras.
        n_frames: Length of the capture.
        clip_length: Frames per clip; motion is scaled to it and "gift" appears with clip 1.
        fps: Frames per second.
    """

    parts: tuple[Part, ...]
    rig: CameraRig
    n_frames: int
    clip_length: int
    fps: float

    @property
    def default_holdout(self) -> tuple[str, ...]:
        """Two cameras inside the ring for evaluation; none when fewer than four cameras are there."""
        n_cameras = len(self.rig)
        if n_cameras < 4:
            return ()
        return (self.rig.names[n_cameras // 4], self.rig.names[2 * n_cameras // 3])

    def part_index(self, name: str) -> int:
        """Row of a part by name. Raises ValueError for an unknown name."""
        return [part.name for part in self.parts].index(name)


def make_scene(
    *,
    size: tuple[int, int] = (320, 240),
    n_cameras: int = SAMPLE_CAMERAS,
    n_frames: int = 30,
    clip_length: int = 10,
    fps: float = 30.0,
) -> SyntheticScene:
    """The sample scene at any size and length.

    Args:
        size: Image width and height of every camera.
        n_cameras: Cameras on the ring.
        n_frames: Length of the capture.
        clip_length: Frames per clip.
        fps: Frames per second.
    Raises:
        ValueError: A number is below 1.
    """
    if min(*size, n_cameras, n_frames, clip_length) < 1:
        raise ValueError("size, n_cameras, n_frames and clip_length must be at least 1")
    return SyntheticScene(make_parts(clip_length), make_rig(n_cameras, size), n_frames, clip_length, fps)


def make_parts(clip_length: int) -> tuple[Part, ...]:
    """The room, three standing things, a turning sculpture, a flying ball and a parcel that appears with clip 1."""
    shell = meshes.box(ROOM_SIZE, is_inward=True).moved(placed(0, 0, ROOM_SIZE[2] / 2))
    pillar = meshes.cylinder(0.14, 1.5)
    plinth = meshes.box((0.52, 0.52, 0.5))
    figure = meshes.joined(
        [
            meshes.box((0.3, 0.3, 0.24)).moved(placed(0, 0, 0.12)),
            meshes.box((0.64, 0.13, 0.13)).moved(placed(0.08, 0, 0.305)),
            meshes.sphere(0.18).moved(placed(0, 0, 0.53)),
            meshes.torus(0.24, 0.045).moved(placed(0, 0, 0.53) @ tilted(65.0)),
        ]
    )
    return (
        Part("room", shell, textures.room, still(np.eye(4))),
        Part("pillar", pillar, textures.spiral, still(placed(-1.3, 0.75, 0.75))),
        Part("crate", meshes.box((0.56, 0.56, 0.56)), textures.planks, still(placed(1.0, 0.75, 0.28, turn_deg=28))),
        Part("plinth", plinth, textures.marble, still(placed(-0.35, -0.3, 0.25, turn_deg=12))),
        Part("sculpture", figure, textures.sculpture, turning(-0.35, -0.3, 0.5, clip_length), is_moving=True),
        Part("ball", meshes.sphere(0.17), textures.beach_ball, flying(clip_length), is_moving=True),
        Part(
            "gift",
            meshes.box((0.48, 0.48, 0.48)),
            textures.gift,
            still(placed(0.75, -0.7, 0.24, turn_deg=-20), from_frame=clip_length),
        ),
    )


def make_rig(n_cameras: int, size: tuple[int, int]) -> CameraRig:
    """Cameras on a ring at two heights, looking inwards; no two have the same intrinsics.

    Args:
        n_cameras: Spread evenly round the room.
        size: Image width and height.
    """
    width, height = size
    generator = np.random.default_rng(20)
    poses, Ks = [], []
    for i in range(n_cameras):
        azimuth = 2 * np.pi * (i + 0.5) / n_cameras
        center = np.array([*(RING_RADIUS * np.array([np.cos(azimuth), np.sin(azimuth)])), RING_HEIGHTS[i % 2]])
        target = FOCUS + generator.uniform(-0.06, 0.06, 3)
        poses.append(looking_at(center, target, roll_deg=float(generator.uniform(-1.5, 1.5))))
        focal = width * generator.uniform(0.745, 0.825)  # 62 to 68 degrees across
        offset = generator.uniform(-0.018, 0.018, 2) * width  # up to 5.8 px at 320
        fx, fy = focal, focal * generator.uniform(0.996, 1.004)
        Ks.append([[fx, 0.0, width / 2 + offset[0]], [0.0, fy, height / 2 + offset[1]], [0.0, 0.0, 1.0]])
    return CameraRig(
        names=tuple(f"cam{i:02d}" for i in range(n_cameras)),
        world_to_camera=np.round(np.stack(poses), 12),
        Ks=np.round(np.array(Ks), 6),
        image_sizes=np.tile(np.array(size, dtype=np.int64), (n_cameras, 1)),
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


def placed(x: float, y: float, z: float, *, turn_deg: float = 0.0) -> np.ndarray:
    """Turn about z, then move. [4, 4]"""
    cos, sin = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    return np.array([[cos, -sin, 0, x], [sin, cos, 0, y], [0, 0, 1, z], [0, 0, 0, 1.0]])


def tilted(angle_deg: float) -> np.ndarray:
    """Turn about x. [4, 4]"""
    cos, sin = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    return np.array([[1.0, 0, 0, 0], [0, cos, -sin, 0], [0, sin, cos, 0], [0, 0, 0, 1.0]])


def still(pose: np.ndarray, *, from_frame: int = 0) -> Callable[[int], np.ndarray | None]:
    """A part that stands from this frame on."""
    return lambda frame_index: pose if frame_index >= from_frame else None


def turning(x: float, y: float, z: float, clip_length: int) -> Callable[[int], np.ndarray | None]:
    """A part that turns in place about z."""
    rate = DEGREES_PER_CLIP_SCULPTURE / clip_length
    return lambda frame_index: placed(x, y, z, turn_deg=rate * frame_index)


def flying(clip_length: int) -> Callable[[int], np.ndarray | None]:
    """The ball: round the room at changing height, turning about a slanted axis."""
    rate = DEGREES_PER_CLIP_BALL / clip_length

    def pose(frame_index: int) -> np.ndarray:
        angle = np.radians(20.0 + rate * frame_index)
        height = 1.15 + 0.22 * np.sin(2.0 * angle)
        position = placed(0.9 * np.cos(angle), 0.9 * np.sin(angle), height)
        return position @ tilted(50.0) @ placed(0, 0, 0, turn_deg=2.0 * rate * frame_index)

    return pose
