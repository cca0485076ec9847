"""The sample scene: a furnished room with parts that stand, turn, fly and appear, and the cameras around it.

World: right-handed, z up, scene units are metres, the floor at z = 0. Nothing is rendered here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app.lab.synthetic import meshes, textures
from app.lab.synthetic.meshes import Mesh
from app.lab.synthetic.rigs import make_rig
from app.lab.synthetic.textures import Texture
from engine.camera.rig import CameraRig

ROOM_SIZE = (6.0, 6.0, 2.8)
"""Inner width, depth and height."""
LIGHT_POSITION = np.array([0.5, -0.7, 2.6])
"""Centre of the lamp."""
LIGHT_RADIUS = 0.45
"""The lamp is a level disc of this radius, which makes shadows soft."""
SAMPLE_CAMERAS = 20
"""18 degrees apart."""
SKY_RADIUS = 25.0
"""Distance of the sky outdoors."""
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
        gloss: Light in the middle of the lamp's highlight, which moves with the viewer; 0 is matt.
    """

    name: str
    mesh: Mesh
    texture: Texture
    pose: Callable[[int], np.ndarray | None]
    is_moving: bool = False
    gloss: float = 0.0


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
    rig: CameraRig | None = None,
    surroundings: str = "room",
) -> SyntheticScene:
    """The sample scene at any size and length.

    Args:
        size: Image width and height of every camera.
        n_cameras: Cameras on the ring.
        n_frames: Length of the capture.
        clip_length: Frames per clip.
        fps: Frames per second.
        rig: Cameras of another kind (app.lab.synthetic.rigs), in place of `size` and `n_cameras`.
        surroundings: One of SURROUNDINGS.
    Raises:
        ValueError: A number is below 1, or there are no such surroundings.
    """
    if surroundings not in SURROUNDINGS:
        raise ValueError(f"no environment called {surroundings}; there are {', '.join(SURROUNDINGS)}")
    if min(*size, n_cameras, n_frames, clip_length) < 1:
        raise ValueError("size, n_cameras, n_frames and clip_length must be at least 1")
    parts = (*SURROUNDINGS[surroundings](), *make_parts(clip_length)[1:])
    rig = make_rig(n_cameras, size) if rig is None else rig
    return SyntheticScene(parts, rig, n_frames, clip_length, fps)


def make_parts(clip_length: int) -> tuple[Part, ...]:
    """The room, three standing things, a turning sculpture, a flying ball and a parcel that appears with clip 1."""
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
        *make_room(),
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


def make_room(texture: Texture = textures.room) -> tuple[Part, ...]:
    """Floor, ceiling and walls."""
    shell = meshes.box(ROOM_SIZE, is_inward=True).moved(placed(0, 0, ROOM_SIZE[2] / 2))
    return (Part("room", shell, texture, still(np.eye(4))),)


def make_outdoors() -> tuple[Part, ...]:
    """A meadow under a sky that is ten times as far away as the things on it."""
    ground = meshes.box((2 * SKY_RADIUS, 2 * SKY_RADIUS, 0.2)).moved(placed(0, 0, -0.1))
    dome = meshes.sphere(SKY_RADIUS)
    inside = Mesh(dome.vertices, dome.triangles[:, ::-1], -dome.corner_normals[:, ::-1])
    return (
        Part("ground", ground, textures.meadow, still(np.eye(4))),
        Part("sky", inside, textures.sky, still(np.eye(4))),
    )


SURROUNDINGS: dict[str, Callable[[], tuple[Part, ...]]] = {
    "room": make_room,
    "bare room": lambda: make_room(textures.bare_room),
    "outdoors": make_outdoors,
}
"""Surroundings of the scene's things, by name."""


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
