"""CameraRig: the calibrated cameras of a capture. Pure numbers; pixels live in a FrameSource."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np


@dataclass(frozen=True, slots=True)
class CameraRig:
    """Calibrated, motionless pinhole cameras. Owns numbers only.

    Attributes:
        names: One per camera, as the capture calls them. C entries.
        world_to_camera: Rigid maps, OpenCV axes, scene units. [C, 4, 4] float64
        Ks: Intrinsics in pixels at `image_sizes`, pixel centres at +0.5. [C, 3, 3] float64
        image_sizes: Width and height. [C, 2] int64
    """

    names: tuple[str, ...]
    world_to_camera: np.ndarray
    Ks: np.ndarray
    image_sizes: np.ndarray

    def __len__(self) -> int:
        return len(self.names)

    @property
    def centers(self) -> np.ndarray:
        """Camera centres in world space, scene units. [C, 3]"""
        rotations = self.world_to_camera[:, :3, :3]
        return -np.einsum("cji,cj->ci", rotations, self.world_to_camera[:, :3, 3])

    @property
    def forwards(self) -> np.ndarray:
        """Unit viewing directions in world space. [C, 3]"""
        return self.world_to_camera[:, 2, :3].copy()

    def up_direction(self) -> np.ndarray:
        """The world direction that the cameras agree is up: the mean of their -y axes, unit length. [3]"""
        up = -self.world_to_camera[:, 1, :3].mean(0) if len(self) else np.zeros(3)
        length = float(np.linalg.norm(up))
        return up / length if length > 1e-6 else np.array([0.0, -1.0, 0.0])

    def subset(self, camera_indices: list[int] | np.ndarray) -> Self:
        """The same rig with only these cameras, in this order."""
        index = np.asarray(camera_indices, dtype=np.int64)
        return type(self)(
            names=tuple(self.names[i] for i in index),
            world_to_camera=self.world_to_camera[index],
            Ks=self.Ks[index],
            image_sizes=self.image_sizes[index],
        )

    def resized(self, image_sizes: np.ndarray) -> Self:
        """Intrinsics for images resampled to other sizes; each axis scales by its actual ratio.

        Args:
            image_sizes: New width and height per camera. [C, 2]
        """
        ratios = np.asarray(image_sizes, dtype=np.float64) / self.image_sizes  # [C, 2]
        Ks = self.Ks.copy()
        Ks[:, 0, :] *= ratios[:, 0:1]  # fx, skew and cx all scale with x because centres lie at +0.5
        Ks[:, 1, :] *= ratios[:, 1:2]
        return type(self)(
            names=self.names,
            world_to_camera=self.world_to_camera,
            Ks=Ks,
            image_sizes=np.asarray(image_sizes, dtype=np.int64),
        )

    @property
    def extent(self) -> float:
        """How far the cameras reach, scene units: 1.1 times the largest distance to their mean, the unit in which 3DGS
        gives the rate of positions."""
        return 1.1 * float(np.linalg.norm(self.centers - self.centers.mean(0), axis=1).max())

    def focus_point(self) -> np.ndarray:
        """The point nearest to all viewing axes in the least-squares sense, in front of the rig. [3]

        For nearly parallel axes (a forward-facing rig) the system is damped towards the point one rig radius
        ahead, so the answer stays finite.
        """
        forwards, centers = self.forwards, self.centers
        projectors = np.eye(3) - forwards[:, :, None] * forwards[:, None, :]  # [C, 3, 3]
        radius = max(float(np.linalg.norm(centers - centers.mean(0), axis=1).max()), 1e-9)
        prior = centers.mean(0) + forwards.mean(0) * radius
        damping = 1e-3 * len(self)
        system = projectors.sum(0) + damping * np.eye(3)
        rhs = np.einsum("cij,cj->i", projectors, centers) + damping * prior
        return np.linalg.solve(system, rhs)


NO_CAMERAS = CameraRig((), np.zeros((0, 4, 4)), np.zeros((0, 3, 3)), np.zeros((0, 2), np.int64))
"""The rig of no capture."""
