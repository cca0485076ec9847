"""Where a scene lies in a file: turned so that another axis is up, and in other units. numpy only."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from engine.camera.rotations import quat_product, quats_of
from engine.export.splats import Splats

AXES: dict[str, tuple[float, float, float]] = {
    "+x": (1.0, 0.0, 0.0),
    "-x": (-1.0, 0.0, 0.0),
    "+y": (0.0, 1.0, 0.0),
    "-y": (0.0, -1.0, 0.0),
    "+z": (0.0, 0.0, 1.0),
    "-z": (0.0, 0.0, -1.0),
}
"""Axes that can be up in a file."""


@dataclass(frozen=True, slots=True)
class FileWorld:
    """A rotation and a scale from the capture's coordinates to those of a file.

    Attributes:
        rotation: [3, 3]
        scale: Units of the file per scene unit, > 0.
        up: Which way is up in the file, unit length. [3]
        text: In words, for whoever reads the file.
    """

    rotation: np.ndarray = field(default_factory=lambda: np.eye(3))
    scale: float = 1.0
    up: tuple[float, float, float] = (0.0, -1.0, 0.0)
    text: str = "as in the capture"

    def placed(self, splats: Splats) -> Splats:
        """The scene as it lies in the file."""
        return replace(self._moved(splats, self.rotation, self.scale), up=self.up)

    def returned(self, splats: Splats) -> Splats:
        """The scene of a file as it lies in the capture: the inverse of `placed`."""
        return self._moved(splats, self.rotation.T, 1.0 / self.scale)

    def placed_cameras(self, world_to_camera: np.ndarray) -> np.ndarray:
        """Cameras as they stand in the file: camera_to_world, rigid, OpenCV axes, units of the file.

        Args:
            world_to_camera: In the capture. [C, 4, 4]
        """
        poses = np.linalg.inv(world_to_camera)
        poses[:, :3] = self.rotation @ poses[:, :3]
        poses[:, :3, 3] *= self.scale
        return poses

    def placed_view(self, world_to_camera: np.ndarray) -> np.ndarray:
        """The same picture from there, of the scene as it lies in the file: rigid, units of the file. [4, 4]"""
        return np.linalg.inv(self.placed_cameras(world_to_camera[None])[0])

    def seen_from(self, other: FileWorld) -> FileWorld:
        """From the coordinates of another file of the same scene to those of this one."""
        return FileWorld(self.rotation @ other.rotation.T, self.scale / other.scale, self.up)

    @staticmethod
    def _moved(splats: Splats, rotation: np.ndarray, scale: float) -> Splats:
        if scale == 1.0 and np.array_equal(rotation, np.eye(3)):
            return splats
        return replace(
            splats,
            means=(scale * (splats.means.astype(np.float64) @ rotation.T)).astype(np.float32),
            quats=quat_product(quats_of(rotation), splats.quats.astype(np.float64)).astype(np.float32),
            scales=(scale * splats.scales.astype(np.float64)).astype(np.float32),
        )


def world(scene_up: np.ndarray, *, up: str | None = None, scale: float = 1.0, is_rub: bool = False) -> FileWorld:
    """How a scene is placed in files.

    Args:
        scene_up: Which way is up in the capture. [3]
        up: One of AXES, which becomes up; None leaves the axes as they are in the capture.
        scale: Units of the file per scene unit.
        is_rub: Turn by 180 degrees about x after that: from x right, y down, z forward to x right, y up, z back.
    Raises:
        ValueError: A direction without length, an axis that is not known, or a scale that is not a positive number.
    """
    if not (np.isfinite(scale) and scale > 0.0):
        raise ValueError(f"scale must be a positive number, got {scale}")
    rotation = np.eye(3) if up is None else rotation_between(scene_up, np.array(AXES[up]))
    words = ["axes as in the capture" if up is None else f"turned so that {up} is up"]
    if is_rub:
        rotation = np.diag([1.0, -1.0, -1.0]) @ rotation
        words.append("y and z reversed")
    words.append("scale as in the capture" if scale == 1.0 else f"{scale:g} units per unit of the capture")
    found = rotation @ (scene_up / np.linalg.norm(scene_up))
    x, y, z = (float(value) for value in found)
    return FileWorld(rotation, scale, (x, y, z), ", ".join(words))


def rotation_between(source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """The smallest rotation that takes one direction to another; half a turn about x, or about y where x is meant.

    Raises:
        ValueError: A direction without length.
    """
    lengths = np.linalg.norm(source), np.linalg.norm(target)
    if not (np.isfinite(lengths).all() and min(lengths) > 0.0):
        raise ValueError("a direction needs a length")
    a, b = source / lengths[0], target / lengths[1]
    if a @ b < -1.0 + 1e-9:
        side = np.eye(3)[0 if abs(a[0]) < 0.9 else 1]
        side = side - (side @ a) * a
        side /= np.linalg.norm(side)
        return 2.0 * np.outer(side, side) - np.eye(3)
    cross = np.cross(a, b)
    K = np.array([[0.0, -cross[2], cross[1]], [cross[2], 0.0, -cross[0]], [-cross[1], cross[0], 0.0]])
    return np.eye(3) + K + K @ K / (1.0 + a @ b)
