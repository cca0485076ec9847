"""Eased moves from one view to another: where a camera is on its way. numpy only."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from engine.camera.rotations import matrices_of, quats_of, quats_of_turns, turns_of_quats

EASE_S = 0.2
"""Duration of a move."""
LONGEST_STEP_S = 0.1
"""A frame that took longer moves no farther than this: unseen motion helps nobody."""


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """A camera described by its pivot.

    Attributes:
        rotation: Its right, down and forward directions as rows, orthonormal. [3, 3]
        pivot: On its axis, scene units. [3]
        distance: From where it seems to stand to the pivot, scene units.
        eye_distance: From where it really stands, which is far away for an orthographic view.
        fov_y: Vertical field of view as seen from `distance`, radians.
    """

    rotation: np.ndarray
    pivot: np.ndarray
    distance: float
    eye_distance: float
    fov_y: float

    @property
    def forward(self) -> np.ndarray:
        """Unit viewing direction. [3]"""
        return self.rotation[2]

    @property
    def standpoint(self) -> np.ndarray:
        """Place where the camera seems to stand. [3]"""
        return self.pivot - self.distance * self.forward

    def world_to_camera(self) -> np.ndarray:
        """Rigid map. [4, 4] float64"""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation
        matrix[:3, 3] = -self.rotation @ self.pivot
        matrix[2, 3] += self.eye_distance  # exact where the eye is far away
        return matrix

    def focal_px(self, height_px: float) -> float:
        """Focal length for a picture of this height, px."""
        return height_px * self.eye_distance / (2.0 * self.distance * math.tan(self.fov_y / 2.0))


def blended(start: Pose, stop: Pose, share: float) -> Pose:
    """The pose that is this share of the way from one to another; exactly one of them at 0 and 1."""
    if share <= 0.0 or share >= 1.0:
        return start if share <= 0.0 else stop
    turn = turns_of_quats(quats_of(stop.rotation @ start.rotation.T))
    return Pose(
        rotation=matrices_of(quats_of_turns(share * turn)) @ start.rotation,
        pivot=(1.0 - share) * start.pivot + share * stop.pivot,
        distance=between(start.distance, stop.distance, share),
        eye_distance=between(start.eye_distance, stop.eye_distance, share),
        fov_y=(1.0 - share) * start.fov_y + share * stop.fov_y,
    )


def between(start: float, stop: float, share: float) -> float:
    """Two positive numbers blended by their ratio: halfway from 1 to 4 is 2."""
    return math.exp((1.0 - share) * math.log(start) + share * math.log(stop))


@dataclass(frozen=True, slots=True, eq=False)
class ViewMotion:
    """A move that is under way; its end is the view's own pose, which may change meanwhile.

    Attributes:
        start: The pose at its beginning.
        camera: The capture camera that was looked through there, or None.
        elapsed_s: None until the first picture of it.
    """

    start: Pose
    camera: int | None
    elapsed_s: float | None = None

    @property
    def share(self) -> float:
        """Share of the way that is done, 0..1: slow at both ends."""
        t = min(max((self.elapsed_s or 0.0) / EASE_S, 0.0), 1.0)
        return t * t * (3.0 - 2.0 * t)

    def advanced(self, dt_s: float) -> ViewMotion | None:
        """The move some time later; None once it is over. The first step only shows where it begins."""
        elapsed_s = 0.0 if self.elapsed_s is None else self.elapsed_s + min(max(dt_s, 0.0), LONGEST_STEP_S)
        return None if elapsed_s >= EASE_S else replace(self, elapsed_s=elapsed_s)
