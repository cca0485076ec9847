"""Boxes and spheres, against slow truths."""

from __future__ import annotations

import numpy as np

from engine.camera.rotations import matrices_of
from engine.editing.edit import Box, Sphere
from engine.editing.selection.in_picture import EXTENT_SIGMAS
from engine.editing.selection.volumes import in_volume
from tests.engine.editing.selection.made_views import scattered

QUAT = (0.5, -0.5, 0.1, 0.7)
QUAT = tuple(float(value) for value in np.array(QUAT) / np.linalg.norm(QUAT))
BOX = Box((0.3, -0.2, 0.5), (0.6, 1.1, 0.9), QUAT)  # pyright: ignore[reportArgumentType]
SPHERE = Sphere((0.3, -0.2, 0.5), 1.3)


def test_centres_in_a_turned_box_and_in_a_sphere() -> None:
    means = scattered(500)[0]
    axes = matrices_of(np.array(QUAT))
    for mean, is_in_box, is_in_sphere in zip(means, in_volume(BOX, means), in_volume(SPHERE, means), strict=True):
        own = [float(axes[:, axis] @ (mean - np.array(BOX.center))) for axis in range(3)]
        assert is_in_box == all(abs(along) <= half for along, half in zip(own, BOX.half_sizes, strict=True))
        assert is_in_sphere == (np.linalg.norm(mean - np.array(SPHERE.center)) <= 1.3)
    assert 5 < in_volume(BOX, means).sum() < in_volume(SPHERE, means).sum() < 400


def test_by_extent_what_reaches_into_a_box_belongs_to_it() -> None:
    means, quats, scales, _ = scattered(300, seed=2)
    by_center, by_extent = in_volume(BOX, means), in_volume(BOX, means, quats=quats, scales=scales)
    assert (by_extent | ~by_center).all()
    assert by_extent.sum() > by_center.sum()
    rng = np.random.default_rng(0)
    rotations = matrices_of(quats / np.linalg.norm(quats, axis=1, keepdims=True))
    for i in np.flatnonzero(~by_extent):  # none of its points within reach lies inside
        ball = rng.normal(size=(400, 3))
        ball *= EXTENT_SIGMAS * rng.random((400, 1)) / np.linalg.norm(ball, axis=1, keepdims=True)
        assert not in_volume(BOX, means[i] + (ball * scales[i]) @ rotations[i].T).any()


def test_by_extent_round_ones_reach_into_a_sphere_as_far_as_they_are_wide() -> None:
    means, quats, scales, _ = scattered(300, seed=3)
    scales[:] = scales[:, :1]
    by_extent = in_volume(SPHERE, means, quats=quats, scales=scales)
    away = np.linalg.norm(means - np.array(SPHERE.center), axis=1) - EXTENT_SIGMAS * scales[:, 0]
    is_clear = np.abs(away - SPHERE.radius) > 1e-5
    assert (by_extent == (away <= SPHERE.radius))[is_clear].all()
    assert by_extent.sum() > in_volume(SPHERE, means).sum()


def test_the_border_belongs_to_it_and_what_is_not_finite_does_not() -> None:
    means = np.array([[1.0, 0, 0], [1.0001, 0, 0], [np.nan, 0, 0], [np.inf, 0, 0], [0, 0, 0]], np.float32)
    quats, scales = np.tile(np.eye(4)[0], (5, 1)), np.full((5, 3), 1e-6)
    quats[4] = 0.0
    for volume in (Box((0, 0, 0), (1, 1, 1)), Sphere((0, 0, 0), 1.0)):
        assert in_volume(volume, means).tolist() == [True, False, False, False, True]
        assert in_volume(volume, means, quats=quats, scales=scales).tolist() == [True, False, False, False, False]
    assert len(in_volume(SPHERE, np.zeros((0, 3)))) == 0
