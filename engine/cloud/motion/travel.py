"""Points of moving surfaces that travel: one point stands for a place on what moves, as long as that stays in sight.

Beginning in the middle of a clip, every surface point is followed through the frames; where the surface of another
frame is not covered by points that came along, new points begin. A path is a velocity and an acceleration.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

COVER_SPACINGS = 0.9
"""A surface point this near to one that came along needs none of its own."""
STRAY_SPACINGS = 1.1
"""A point that is farther from the surface than this has left it."""
MOST_FRAMES = 10
"""So long a point is followed at most, into the past and into the future: no parabola goes farther with a person."""
N_NEAR = 4
N_NEAR_BACK = 8
_LEAST_SQUARE = 1.0
"""Frames^4: with one frame besides that of birth there is a velocity alone."""


@dataclass(frozen=True, slots=True)
class Travellers:
    """Points that travel.

    Attributes:
        points: Where they are at birth, scene units. [P, 3] float64
        birth_frames: [P] int64
        velocities, accelerations: See engine.model.motion.AnchorMotion. [P, 3] float64
        presence: On the surface in that frame. [P, M] bool
    """

    points: np.ndarray
    birth_frames: np.ndarray
    velocities: np.ndarray
    accelerations: np.ndarray
    presence: np.ndarray

    def at(self, frame: int) -> np.ndarray:
        """Where they are at a frame. [P, 3]"""
        since = (frame - self.birth_frames)[:, None]
        return self.points + since * (self.velocities + since * self.accelerations)


def follow(surfaces: Sequence[np.ndarray], steps: Sequence[np.ndarray], spacing: float) -> Travellers:
    """Travelling points that cover the surfaces of all frames.

    Args:
        surfaces: Surface points of each frame, scene units. [S, 3] each
        steps: How far those of each frame but the last go until the next. [S, 3] each
        spacing: Distance between neighbours, scene units.
    """
    n_frames = len(surfaces)
    trees = [KDTree(surface) if len(surface) else None for surface in surfaces]
    back = [np.zeros((0, 3)), *(_reversed(surfaces[k], steps[k], surfaces[k + 1]) for k in range(n_frames - 1))]
    middle = n_frames // 2
    covered = [np.zeros(len(surface), bool) for surface in surfaces]
    parts = []
    for birth in sorted(range(n_frames), key=lambda frame: (abs(frame - middle), frame)):
        rows = np.flatnonzero(~covered[birth])
        paths, presence = np.zeros((len(rows), n_frames, 3)), np.zeros((len(rows), n_frames), bool)
        presence[:, birth] = True
        # towards the middle everything is covered already
        for direction in [side for side in (1, -1) if (birth - middle) * side >= 0]:
            positions, is_there = surfaces[birth][rows], np.ones(len(rows), bool)
            for frame in range(birth + direction, birth + direction * (MOST_FRAMES + 1), direction):
                before, tree = trees[frame - direction], trees[frame] if 0 <= frame < n_frames else None
                if before is None or tree is None or not is_there.any():
                    break
                moves = steps[frame - 1] if direction > 0 else back[frame + 1]
                positions = positions + _mean_of_nearest(before, moves, positions, spacing)
                is_there &= tree.query(positions)[0] < STRAY_SPACINGS * spacing
                paths[:, frame], presence[:, frame] = positions - surfaces[birth][rows], is_there
        velocities, accelerations = _parabolas(paths, presence, birth)
        part = Travellers(surfaces[birth][rows], np.full(len(rows), birth), velocities, accelerations, presence)
        parts.append(part)
        _cover(covered, surfaces, part, spacing)
    return Travellers(*(np.concatenate([getattr(part, name) for part in parts]) for name in Travellers.__slots__))


def _cover(covered: list[np.ndarray], surfaces: Sequence[np.ndarray], part: Travellers, spacing: float) -> None:
    for frame, surface in enumerate(surfaces):
        here = part.at(frame)[part.presence[:, frame]]
        if len(here) and len(surface):
            covered[frame] |= KDTree(here).query(surface)[0] < COVER_SPACINGS * spacing


def _mean_of_nearest(tree: KDTree, steps: np.ndarray, positions: np.ndarray, spacing: float) -> np.ndarray:
    """Steps of the nearest surface points, nearer ones counting more. [n, 3]"""
    distances, near = tree.query(positions, k=min(N_NEAR, tree.n))
    shape = len(positions), -1
    weights = 1.0 / (distances.reshape(shape) + 0.3 * spacing)
    return (steps[near.reshape(shape)] * weights[..., None]).sum(1) / weights.sum(1, keepdims=True)


def _reversed(surface: np.ndarray, steps: np.ndarray, after: np.ndarray) -> np.ndarray:
    """How far the surface points of the next frame were away one frame before. [len(after), 3]"""
    if len(surface) == 0 or len(after) == 0:
        return np.zeros((len(after), 3))
    _, near = KDTree(surface + steps).query(after, k=min(N_NEAR_BACK, len(surface)))
    return -np.median(steps[near.reshape(len(after), -1)], axis=1)


def _parabolas(paths: np.ndarray, presence: np.ndarray, birth: int) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and acceleration that fit paths best where the points are present. [n, 3] each"""
    since = np.arange(paths.shape[1]) - float(birth)
    s2, s3, s4 = (presence @ since**power for power in (2, 3, 4))
    s4 = s4 + _LEAST_SQUARE
    first, second = (np.einsum("nk,nkc->nc", presence * since**power, paths) for power in (1, 2))
    determinant = np.maximum(s2 * s4 - s3 * s3, 1e-9)[:, None]  # 0 where there is no other frame, and no path
    velocities = (s4[:, None] * first - s3[:, None] * second) / determinant
    accelerations = (s2[:, None] * second - s3[:, None] * first) / determinant
    return velocities, accelerations
