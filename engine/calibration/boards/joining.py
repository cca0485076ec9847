"""Where cameras stand relative to each other, from boards that two see at the same moment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree

Pose = tuple[np.ndarray, np.ndarray]
"""Rotation [3, 3] and translation [3]."""
AGREES_DEG, AGREES_SHARE = 5.0, 0.1
"""Within which two views of a board say the same about two cameras: their turn, and their offset as a share of the
distance to the board. Far boards seen from the front can be held in two ways; the wrong ones disagree."""
MIN_COMMON = 4
"""Moments that have to agree for two cameras to be joined."""


@dataclass(frozen=True, slots=True)
class JoinedCameras:
    """What holds together.

    Attributes:
        rows: Which cameras, rising. [R]
        poses: World to camera, in this order; the world is that of one of them.
        n_common: Moments in which two cameras agree about a board. [C, C]
    """

    rows: np.ndarray
    poses: list[Pose]
    n_common: np.ndarray


def joined(n_cameras: int, boards: Sequence[Mapping[int, Pose]]) -> JoinedCameras | None:
    """The largest group of cameras that boards join; None where they join no two.

    Args:
        n_cameras: C
        boards: For each moment and camera that sees the board, from the board to the camera.
    """
    n_common = np.zeros((n_cameras, n_cameras), dtype=np.int64)
    steps: dict[tuple[int, int], Pose] = {}
    for a in range(n_cameras):
        for b in range(a + 1, n_cameras):
            both = [(moment[a], moment[b]) for moment in boards if a in moment and b in moment]
            step, n = _agreed([_between(*pair) for pair in both], [float(pair[1][1][2]) for pair in both])
            if step is not None and n >= MIN_COMMON:
                n_common[a, b] = n_common[b, a] = n
                steps[a, b], steps[b, a] = step, _inverse(step)
    _, groups = connected_components(csr_matrix(n_common), directed=False)
    sizes = np.bincount(groups)
    if sizes.max() < 2:
        return None
    members = np.flatnonzero(groups == sizes.argmax())
    root = int(members[n_common[members].sum(1).argmax()])
    with np.errstate(divide="ignore"):
        tree = minimum_spanning_tree(csr_matrix(np.where(n_common > 0, 1.0 / n_common, 0.0)))
    order, before = breadth_first_order(tree, root, directed=False)
    poses: dict[int, Pose] = {root: (np.eye(3), np.zeros(3))}
    for row in order[1:].tolist():
        poses[row] = _after(poses[int(before[row])], steps[int(before[row]), row])
    return JoinedCameras(members, [poses[row] for row in members.tolist()], n_common)


def _agreed(steps: Sequence[Pose], distances: Sequence[float]) -> tuple[Pose | None, int]:
    """The step that most others agree with, and how many."""
    if not steps:
        return None, 0
    rotations, shifts = np.array([step[0] for step in steps]), np.array([step[1] for step in steps])
    cosines = (np.einsum("aij,bij->ab", rotations, rotations) - 1) / 2
    is_near = np.degrees(np.arccos(np.clip(cosines, -1, 1))) < AGREES_DEG
    off = np.linalg.norm(shifts[:, None] - shifts[None], axis=-1)
    is_near &= off < AGREES_SHARE * np.array(distances)[:, None]
    best = int(is_near.sum(1).argmax())
    near = is_near[best]
    U, _, Vt = np.linalg.svd(rotations[near].sum(0))
    return (U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt, np.median(shifts[near], axis=0)), int(near.sum())


def _between(first: Pose, second: Pose) -> Pose:
    """From the first camera to the second, of poses from a board to each."""
    rotation = second[0] @ first[0].T
    return rotation, second[1] - rotation @ first[1]


def _inverse(pose: Pose) -> Pose:
    return pose[0].T, -pose[0].T @ pose[1]


def _after(first: Pose, second: Pose) -> Pose:
    """The first, then the second."""
    return second[0] @ first[0], second[0] @ first[1] + second[1]
