"""Matches of generated rigs whose truth is known, without pictures: places in the room, seen with some noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from engine.camera.projection import is_in_picture, project, projection_matrices
from engine.camera.rig import CameraRig
from engine.doctor.neighbours import neighbour_pairs
from engine.doctor.refit import rotation_of
from engine.features.matching import PairMatches

NOISE_PX = 0.3
WRONG_SHARE = 0.1
N_SHARED = 45
"""Matches of a pair, as between real neighbours."""


@pytest.fixture
def matches_in() -> Callable[[CameraRig], list[PairMatches]]:
    """matches_in(rig): see made_matches."""
    return made_matches


def made_matches(rig: CameraRig) -> list[PairMatches]:
    """What SIFT would find between neighbours, some of it wrong."""
    rng = np.random.default_rng(5)
    places = rng.uniform([-1.9, -1.9, 0.0], [1.9, 1.9, 2.0], (3000, 3))
    width, height = (int(value) for value in rig.image_sizes[0])
    seen = [project(places, matrix) for matrix in projection_matrices(rig)]
    is_seen = [is_in_picture(*one, width, height) & (one[1] > 0.3) for one in seen]
    pairs = []
    for a, b in neighbour_pairs(rig):
        rows = np.flatnonzero(is_seen[a] & is_seen[b])
        rows = rng.permutation(rows)[:N_SHARED]
        here = seen[a][0][rows] + rng.normal(0, NOISE_PX, (len(rows), 2))
        there = seen[b][0][rows] + rng.normal(0, NOISE_PX, (len(rows), 2))
        is_wrong = rng.uniform(size=len(rows)) < WRONG_SHARE
        there[is_wrong] = rng.uniform(0, [width, height], (int(is_wrong.sum()), 2))
        pairs.append(PairMatches(a, b, here, there, np.stack([rows, rows], -1)))
    return pairs


def with_focal(rig: CameraRig, camera: int, factor: float) -> CameraRig:
    """The rig with a wrong focal length of one camera."""
    Ks = rig.Ks.copy()
    Ks[camera, :2, :2] *= factor
    return replace(rig, Ks=Ks)


def with_turn(rig: CameraRig, camera: int, degrees: float) -> CameraRig:
    """The rig with one camera turned about some axis."""
    axis = np.random.default_rng(camera).normal(size=3)
    poses = rig.world_to_camera.copy()
    poses[camera, :3] = rotation_of(np.radians(degrees) * axis / np.linalg.norm(axis)) @ poses[camera, :3]
    return replace(rig, world_to_camera=poses)
