"""Virtual cameras around the contents of a scene that no camera took."""

from __future__ import annotations

import math

import numpy as np

from engine.camera.path_presets import DEFAULT_FOV_Y_RAD, turntable
from engine.camera.projection import pinhole_K
from engine.camera.rig import CameraRig
from engine.clip_files.stored_gaussians import StoredGaussians

N_VIEWS = 8
VIEW_NAMES = tuple(f"view{number}" for number in range(N_VIEWS))
IMAGE_SIZE = (960, 720)
ELEVATION_RAD = math.radians(15.0)
_DISTANCE = 1.15 / math.sin(DEFAULT_FOV_Y_RAD / 2)
"""In radii of the contents: they fill the picture but for a margin."""
_CONTENTS = 0.8
"""Share of the Gaussians that are within the radius of the contents; others are taken for surroundings."""
_LEAST_MOVING = 0.3
"""Radius of the contents at least, as a share of that of the whole scene, where something moves in surroundings."""
_SAMPLE = 100_000


class Contents:
    """Where the Gaussians of a scene are: what moves, in surroundings or without, or where nothing does, all of it."""

    def __init__(self) -> None:
        self._spheres: list[np.ndarray] = []

    def add(self, clip: StoredGaussians) -> None:
        """Take a clip into account; one without Gaussians says nothing."""
        moving = clip.moving["means"]
        every = _sphere(np.concatenate([clip.still["means"], moving]))
        around = every if not len(moving) else _sphere(moving)
        if every is None or around is None:
            return
        around[3] = np.clip(around[3], _LEAST_MOVING * every[3], every[3])
        self._spheres.append(around)

    @property
    def _sphere(self) -> np.ndarray:
        return np.median(self._spheres, axis=0) if self._spheres else np.array([0.0, 0.0, 0.0, 1.0])

    @property
    def distance(self) -> float:
        """How far from the middle a camera sees all of them, scene units."""
        *center, radius = self._sphere.tolist()
        return _DISTANCE * max(radius, 1e-6 * (1.0 + max(map(abs, center))))

    def views(self, up: np.ndarray) -> CameraRig:
        """Cameras on a ring around the contents. up: [3]"""
        path = turntable(self._sphere[:3], up, self.distance, ELEVATION_RAD, (0, N_VIEWS))
        return CameraRig(
            names=VIEW_NAMES,
            world_to_camera=path.poses(np.arange(N_VIEWS))[0],
            Ks=np.tile(pinhole_K(DEFAULT_FOV_Y_RAD, IMAGE_SIZE), (N_VIEWS, 1, 1)),
            image_sizes=np.tile(np.array(IMAGE_SIZE, np.int64), (N_VIEWS, 1)),
        )


def _sphere(means: np.ndarray) -> np.ndarray | None:
    """Center and radius of most of some Gaussians; None without any. [4]"""
    if not len(means):
        return None
    some = means[:: max(len(means) // _SAMPLE, 1)].astype(np.float64)
    center = np.median(some, axis=0)
    return np.append(center, np.quantile(np.linalg.norm(some - center, axis=1), _CONTENTS))
