"""Virtual cameras around the contents of a scene that no camera took."""

from __future__ import annotations

import math

import numpy as np

from engine.camera.path_presets import DEFAULT_FOV_Y_RAD, turntable
from engine.camera.projection import pinhole_K
from engine.camera.rig import CameraRig
from engine.export.splats import Splats

N_VIEWS = 8
VIEW_NAMES = tuple(f"view{number}" for number in range(N_VIEWS))
IMAGE_SIZE = (960, 720)
ELEVATION_RAD = math.radians(15.0)
_DISTANCE = 1.15 / math.sin(DEFAULT_FOV_Y_RAD / 2)
"""In radii of the contents: they fill the picture but for a margin."""
_CONTENTS = 0.8
"""Share of the Gaussians that are within the radius of the contents; others are taken for surroundings."""
_SAMPLE = 100_000


class Contents:
    """Where the Gaussians of a scene are, from all frames that were shown to it."""

    def __init__(self) -> None:
        self._centers: list[np.ndarray] = []
        self._radii: list[float] = []

    def add(self, splats: Splats) -> None:
        """Take a frame into account; one without Gaussians says nothing."""
        means = splats.means[:: max(len(splats) // _SAMPLE, 1)].astype(np.float64)
        if len(means):
            center = np.median(means, axis=0)
            self._centers.append(center)
            self._radii.append(float(np.quantile(np.linalg.norm(means - center, axis=1), _CONTENTS)))

    @property
    def center(self) -> np.ndarray:
        """Their middle. [3]"""
        return np.median(self._centers, axis=0) if self._centers else np.zeros(3)

    @property
    def distance(self) -> float:
        """How far from the middle a camera sees all of them, scene units."""
        least = 1e-6 * (1.0 + float(np.abs(self.center).max()))
        return _DISTANCE * max(float(np.median(self._radii)) if self._radii else 1.0, least)

    def views(self, up: np.ndarray) -> CameraRig:
        """Cameras on a ring around the contents. up: [3]"""
        path = turntable(self.center, up, self.distance, ELEVATION_RAD, (0, N_VIEWS))
        return CameraRig(
            names=VIEW_NAMES,
            world_to_camera=path.poses(np.arange(N_VIEWS))[0],
            Ks=np.tile(pinhole_K(DEFAULT_FOV_Y_RAD, IMAGE_SIZE), (N_VIEWS, 1, 1)),
            image_sizes=np.tile(np.array(IMAGE_SIZE, np.int64), (N_VIEWS, 1)),
        )
