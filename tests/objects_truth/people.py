"""A person of five parts who walks: trunk with head, two arms, two legs, which swing with the way gone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app.lab.synthetic import meshes
from app.lab.synthetic.scene import Part, placed, tilted
from app.lab.synthetic.textures import Texture, cloudy, mix, rgb, step

HIP, SHOULDER, HEIGHT = 0.66, 1.12, 1.43
"""Heights above the floor, scene units."""
ARM_LENGTH = 0.52
"""From the shoulder to the end of the hand, scene units."""
SWING_DEG, STRIDE = 26.0, 0.62
"""Most that arms and legs swing, and the way that one full swing takes, scene units."""


@dataclass(frozen=True, slots=True)
class Walk:
    """Where somebody is: straight between moments, at rest before the first and after the last.

    Attributes:
        moments: Rows of frame, x, y and heading (degrees; 0 looks along +y), frames rising. [M, 4]
        absent: Frames [first, stop) in which the person is not in the scene.
    """

    moments: np.ndarray
    absent: tuple[int, int] | None = None

    def is_there(self, frame_index: int) -> bool:
        """Whether the person is in the scene."""
        return self.absent is None or not self.absent[0] <= frame_index < self.absent[1]

    def pose(self, frame_index: int) -> np.ndarray:
        """The map of the person's own space, feet at the origin, to the world. [4, 4]"""
        frames, *columns = self.moments.T
        x, y, heading = (float(np.interp(frame_index, frames, column)) for column in columns)
        return placed(x, y, 0.0, turn_deg=heading)

    def way(self, frame_index: int) -> float:
        """The way gone since the first moment, scene units."""
        way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self.moments[:, 1:3], axis=0), axis=1))])
        return float(np.interp(frame_index, self.moments[:, 0], way))


def walk(*moments: tuple[float, float, float, float], absent: tuple[int, int] | None = None) -> Walk:
    """From rows of frame, x, y and heading."""
    return Walk(np.array(moments), absent)


@dataclass(frozen=True, slots=True)
class Clothes:
    """Colours of a person, six hex digits each."""

    shirt: str
    stripes: str
    trousers: str
    hair: str


Raise = Callable[[int], float]
"""frame_index -> by how much the right arm is raised to the front, degrees; 0 lets it swing."""


def make_person(name: str, way: Walk, clothes: Clothes, *, seed: int, raised: Raise = lambda frame: 0.0) -> list[Part]:
    """The five parts of a person: NAME.trunk, NAME.arm_left and so on.

    Args:
        name: Of the person.
        way: Where the person is.
        clothes: Colours.
        seed: Of the pattern of cloth.
        raised: The right arm.
    """
    texture = _texture(clothes, seed)

    def trunk(frame_index: int) -> np.ndarray | None:
        return way.pose(frame_index) if way.is_there(frame_index) else None

    def limb(side: float, height: float, sign: float, is_raised: bool = False) -> Callable[[int], np.ndarray | None]:
        def pose(frame_index: int) -> np.ndarray | None:
            if not way.is_there(frame_index):
                return None
            angle = sign * SWING_DEG * np.sin(2 * np.pi * way.way(frame_index) / STRIDE)
            if is_raised:
                angle = raised(frame_index) or angle
            return way.pose(frame_index) @ placed(side, 0.0, height) @ tilted(float(angle))

        return pose

    def part(which: str, mesh: meshes.Mesh, texture: Texture, pose: Callable[[int], np.ndarray | None]) -> Part:
        return Part(f"{name}.{which}", mesh, texture, pose, is_moving=True)

    sleeve = _limb_texture(clothes.shirt, "d8a888", -0.3, seed)
    trouser = _limb_texture(clothes.trousers, "332a26", -0.58, seed + 1)
    return [
        part("trunk", _trunk(), texture, trunk),
        part("arm_left", _hanging(0.055, ARM_LENGTH), sleeve, limb(-0.215, SHOULDER, 1.0)),
        part("arm_right", _hanging(0.055, ARM_LENGTH), sleeve, limb(0.215, SHOULDER, -1.0, is_raised=True)),
        part("leg_left", _hanging(0.08, HIP), trouser, limb(-0.09, HIP, -1.0)),
        part("leg_right", _hanging(0.08, HIP), trouser, limb(0.09, HIP, 1.0)),
    ]


def hand(way: Walk, raised: Raise, frame_index: int) -> np.ndarray:
    """Where the end of the right hand is, while that arm is raised. [3] world"""
    arm = way.pose(frame_index) @ placed(0.215, 0.0, SHOULDER) @ tilted(raised(frame_index))
    return (arm @ np.array([0.0, 0.0, -ARM_LENGTH - 0.06, 1.0]))[:3]


def _trunk() -> meshes.Mesh:
    return meshes.joined(
        [
            meshes.box((0.34, 0.2, 0.54)).moved(placed(0, 0, HIP + 0.22)),
            meshes.cylinder(0.05, 0.1, n_around=16).moved(placed(0, 0, 1.19)),
            meshes.sphere(0.12, n_around=24).moved(placed(0, 0, HEIGHT - 0.12)),
        ]
    )


def _hanging(radius: float, length: float) -> meshes.Mesh:
    """A limb that hangs down from the origin."""
    return meshes.cylinder(radius, length, n_around=16).moved(placed(0, 0, -length / 2))


def _texture(clothes: Clothes, seed: int) -> Texture:
    """Hair, face, a striped shirt and a little of the trousers, by height."""

    def texture(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        height = points[:, 2]
        stripes = step(np.sin(height * 38.0), 0.2, 0.4)
        color = mix(
            rgb(clothes.trousers), mix(rgb(clothes.shirt), rgb(clothes.stripes), stripes), step(height, 0.7, 0.02)
        )
        color = mix(color, rgb("d8a888"), step(height, 1.155, 0.02))
        is_hair = np.maximum(step(height, 1.37, 0.02), step(height, 1.26, 0.02) * step(-points[:, 1], -0.02, 0.03))
        color = mix(color, rgb(clothes.hair), is_hair)
        return color * (0.85 + 0.3 * cloudy(points * 9.0, seed))[:, None]

    return texture


def _limb_texture(cloth: str, end: str, end_height: float, seed: int) -> Texture:
    """Cloth, and skin or a shoe below."""

    def texture(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        color = mix(rgb(end), rgb(cloth), step(points[:, 2], end_height, 0.02))
        return color * (0.85 + 0.3 * cloudy(points * 9.0, seed))[:, None]

    return texture
