"""CameraPath: a camera that moves with time, smoothly through poses that somebody chose. Pure numbers.

Positions, rotations and fields of view all follow cubic pieces with the times of the keys as parameter, so that a key
is reached exactly at its frame. Tangents come from the parabola through a key and its neighbours, which makes evenly
spaced keys a Catmull-Rom spline, and are then held back where they would run past a key: along the line between two
neighbouring keys the camera only ever goes forward, and two equal keys stand still. A natural spline is smoother by
one derivative, but swings out where keys are unevenly spaced, and moving one of its keys changes all of the path; here
it changes the two pieces on either side.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Self

import numpy as np

from engine.camera.key_curves import along_curve, tangents_of
from engine.camera.projection import camera_center
from engine.camera.rotations import (
    inverse_quats,
    matrices_of,
    quat_product,
    quats_of,
    quats_of_turns,
    turns_of_quats,
)
from engine.errors import ProjectError

MIN_SPACING_FRAMES = 1e-3
"""Keys of one path are at least this far apart in time."""
MAX_FRAME = 1e9
"""Times of keys lie between plus and minus this."""
MAX_DISTANCE = 1e12
"""No camera stands farther from the origin, scene units."""
MIN_FOV_RAD, MAX_FOV_RAD = 1e-3, 3.14
_RIGID_TOLERANCE = 1e-5


@dataclass(frozen=True, slots=True, eq=False)
class CameraKey:
    """One pose on a path. A value.

    Attributes:
        frame: When, in frames of the capture; may lie between two frames.
        world_to_camera: Rigid map, OpenCV axes, scene units. [4, 4] float64
        fov_y_rad: Vertical field of view, from MIN_FOV_RAD to MAX_FOV_RAD.

    Raises:
        ValueError: A value is not valid; says which.
    """

    frame: float
    world_to_camera: np.ndarray
    fov_y_rad: float

    def __post_init__(self) -> None:
        matrix = np.array(self.world_to_camera, dtype=np.float64)
        if not (math.isfinite(self.frame) and abs(self.frame) <= MAX_FRAME):
            raise ValueError(f"the frame of a key is {self.frame!r}")
        if not MIN_FOV_RAD <= self.fov_y_rad <= MAX_FOV_RAD:
            raise ValueError(
                f"the field of view of a key is {self.fov_y_rad!r} rad, not from {MIN_FOV_RAD} to {MAX_FOV_RAD}"
            )
        if matrix.shape != (4, 4) or not _is_rigid(matrix):
            raise ValueError("the pose of a key is not a rotation and a translation")
        matrix.flags.writeable = False
        object.__setattr__(self, "frame", float(self.frame))
        object.__setattr__(self, "world_to_camera", matrix)
        object.__setattr__(self, "fov_y_rad", float(self.fov_y_rad))

    @property
    def center(self) -> np.ndarray:
        """Where the camera stands in the world, scene units. [3]"""
        return camera_center(self.world_to_camera)

    def at_frame(self, frame: float) -> Self:
        """The same pose at another time."""
        return replace(self, frame=frame)

    def at_center(self, center: np.ndarray) -> Self:
        """The same key at another place, turned as it is. center: Scene units. [3]"""
        matrix = self.world_to_camera.copy()
        matrix[:3, 3] = -matrix[:3, :3] @ np.asarray(center, dtype=np.float64)
        return replace(self, world_to_camera=matrix)


@dataclass(frozen=True, eq=False)
class CameraPath:
    """Keys in the order of time, and what lies between them. A value.

    Before the first key the camera stands at the first one, after the last key at the last one. A closed path continues
    from the last key to the first one, in the mean time from key to key, and round and round, both ways.

    Attributes:
        name: As the user wrote it.
        keys: Ascending in time, at least MIN_SPACING_FRAMES apart; there may be none.
        is_closed: Whether it is a loop.

    Raises:
        ValueError: The name is empty, or keys are not in order or too close.
    """

    name: str
    keys: tuple[CameraKey, ...] = ()
    is_closed: bool = False

    def __post_init__(self) -> None:
        if not self.name.strip():
            raise ValueError("a camera path has no name")
        object.__setattr__(self, "keys", tuple(self.keys))
        frames = [key.frame for key in self.keys]
        for before, after in pairwise(frames):
            if after - before < MIN_SPACING_FRAMES:
                raise ValueError(f"keys of the path are not in order or too close: {before:g} and {after:g}")

    @property
    def period_frames(self) -> float | None:
        """How long one round of a closed path takes; None for an open one, and with fewer than two keys."""
        if not self.is_closed or len(self.keys) < 2:
            return None
        span = self.keys[-1].frame - self.keys[0].frame
        return span * len(self.keys) / (len(self.keys) - 1)

    @property
    def frame_range(self) -> tuple[float, float]:
        """When it moves: from the first key to the last one, and of a closed path to where it is back.

        Raises:
            ProjectError: There are no keys.
        """
        self._check_keys()
        period = self.period_frames
        first = self.keys[0].frame
        return first, self.keys[-1].frame if period is None else first + period

    def at(self, frame: float) -> tuple[np.ndarray, float]:
        """World to camera [4, 4] float64 and the vertical field of view in radians at a frame, which may be a fraction.

        Raises:
            ProjectError: There are no keys.
        """
        matrices, fovs = self.poses(np.array([frame]))
        return matrices[0], float(fovs[0])

    def poses(self, frames: np.ndarray | Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
        """World to camera [F, 4, 4] and vertical fields of view [F], radians, at several frames [F].

        Raises:
            ProjectError: There are no keys.
        """
        self._check_keys()
        piece, share = self._found(np.asarray(frames, dtype=np.float64))
        rotations = self._curves.rotation(piece, share)
        matrices = np.tile(np.eye(4), (len(piece), 1, 1))
        matrices[:, :3, :3] = rotations
        matrices[:, :3, 3] = -np.einsum("fij,fj->fi", rotations, self._curves.center(piece, share))
        return matrices, np.exp(self._curves.log_fov(piece, share))

    def centers(self, frames: np.ndarray | Sequence[float]) -> np.ndarray:
        """Where the camera stands at several frames [F], scene units. [F, 3]

        Raises:
            ProjectError: There are no keys.
        """
        self._check_keys()
        return self._curves.center(*self._found(np.asarray(frames, dtype=np.float64)))

    def _check_keys(self) -> None:
        if not self.keys:
            raise ProjectError(f'The camera path "{self.name}" has no keys.', hint="Add a key to it first.")

    @cached_property
    def _curves(self) -> _Curves:
        return _Curves(self.keys, self.period_frames)

    def _found(self, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which piece each frame lies in, and how far along it is, 0..1. [F] int64, [F]"""
        times, period = self._curves.times, self.period_frames
        if len(times) < 2:
            return np.zeros(len(frames), np.int64), np.zeros(len(frames))
        if period is not None:
            frames = times[0] + np.mod(frames - times[0], period)
        frames = np.clip(frames, times[0], times[-1])
        piece = np.clip(np.searchsorted(times, frames, side="right") - 1, 0, len(times) - 2)
        return piece, (frames - times[piece]) / (times[piece + 1] - times[piece])


class _Curves:
    """The pieces of a path with everything that depends on all keys, worked out once.

    Attributes:
        times: Frames of the keys, and for a loop the one at which the first key comes again. [P + 1]
    """

    def __init__(self, keys: Sequence[CameraKey], period: float | None) -> None:
        is_loop = period is not None
        used = [*keys, keys[0]] if is_loop else list(keys)
        self.times = np.array([key.frame for key in used])
        if is_loop:
            self.times[-1] = self.times[0] + period
        self._lengths = np.diff(self.times)  # [P]
        self._centers = np.stack([key.center for key in used])  # [P + 1, 3]
        self._log_fovs = np.log([[key.fov_y_rad] for key in used])  # [P + 1, 1]
        # camera to world: a rotation vector from one key to the next is then in the axes of the camera
        self._quats = quats_of(np.stack([key.world_to_camera[:3, :3].T for key in used]))  # [P + 1, 4]
        if len(used) < 2:
            return
        between = quat_product(inverse_quats(self._quats[:-1]), self._quats[1:])
        self._turn_rates = tangents_of(turns_of_quats(between), self._lengths, is_loop=is_loop)
        self._speeds = tangents_of(np.diff(self._centers, axis=0), self._lengths, is_loop=is_loop)
        self._log_fov_rates = tangents_of(np.diff(self._log_fovs, axis=0), self._lengths, is_loop=is_loop)
        first = self._turn_rates[:-1] * self._lengths[:, None] / 3.0
        last = self._turn_rates[1:] * self._lengths[:, None] / 3.0
        middle = quat_product(quats_of_turns(-first), quat_product(between, quats_of_turns(-last)))
        self._turns = np.stack([first, turns_of_quats(middle), last])  # [3, P, 3]

    def center(self, piece: np.ndarray, share: np.ndarray) -> np.ndarray:
        """Positions, scene units. [F, 3]"""
        return self._hermite(self._centers, "_speeds", piece, share)

    def log_fov(self, piece: np.ndarray, share: np.ndarray) -> np.ndarray:
        """Logarithms of the fields of view. [F]"""
        return self._hermite(self._log_fovs, "_log_fov_rates", piece, share)[:, 0]

    def _hermite(self, values: np.ndarray, rates: str, piece: np.ndarray, share: np.ndarray) -> np.ndarray:
        if len(values) < 2:
            return np.repeat(values, len(piece), axis=0)
        return along_curve(values, getattr(self, rates), self._lengths, piece, share)

    def rotation(self, piece: np.ndarray, share: np.ndarray) -> np.ndarray:
        """World to camera: the cubic Bezier curve on the sphere of rotations with the turn rates of its ends, written
        as three turns one after the other (Kim, Kim and Shin 1995). [F, 3, 3]"""
        turned = self._quats[piece]
        if len(self._quats) < 2:
            return matrices_of(inverse_quats(turned))
        t = share
        weights = (1 - (1 - t) ** 3, t * t * (3 - 2 * t), t**3)
        for weight, turn in zip(weights, self._turns, strict=True):
            turned = quat_product(turned, quats_of_turns(weight[:, None] * turn[piece]))
        return matrices_of(inverse_quats(turned))


def _is_rigid(matrix: np.ndarray) -> bool:
    rotation = matrix[:3, :3]
    if not (np.abs(rotation) < 2.0).all() or not (np.abs(matrix[:3, 3]) <= MAX_DISTANCE).all():  # NaN is neither
        return False
    return (
        bool(np.abs(rotation @ rotation.T - np.eye(3)).max() < _RIGID_TOLERANCE)
        and float(np.linalg.det(rotation)) > 0
        and bool(np.abs(matrix[3] - [0.0, 0.0, 0.0, 1.0]).max() < _RIGID_TOLERANCE)
    )
