"""Rotations against scipy's, in all directions and at the angles where formulas divide by small numbers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from engine.camera.rotations import (
    inverse_quats,
    matrices_of,
    quat_product,
    quats_of,
    quats_of_turns,
    turns_of_quats,
)


@pytest.fixture(scope="module")
def turns() -> np.ndarray:
    """Rotation vectors of all kinds: tiny ones, half turns about axes and between them, and random ones. [N, 3]"""
    random = np.random.default_rng(0)
    axes = np.concatenate([np.eye(3), -np.eye(3), random.normal(size=(40, 3))])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    angles = np.array([0.0, 1e-14, 1e-9, 1e-5, 0.3, 1.5, 3.0, np.pi - 1e-6, np.pi - 1e-12])
    return (angles[:, None, None] * axes).reshape(-1, 3)


def test_turns_become_matrices_and_come_back(turns):
    rotations = Rotation.from_rotvec(turns)
    quats = quats_of_turns(turns)
    assert np.allclose(matrices_of(quats), rotations.as_matrix(), atol=1e-12)
    assert np.allclose(turns_of_quats(quats), turns, atol=1e-12)
    assert np.allclose(turns_of_quats(-quats), turns, atol=1e-12), "both signs are the same rotation"


def test_matrices_become_quaternions(turns):
    quats = quats_of(Rotation.from_rotvec(turns).as_matrix())
    assert np.allclose(np.linalg.norm(quats, axis=-1), 1.0)
    assert (quats[:, 0] >= 0).all()
    assert np.allclose(matrices_of(quats), Rotation.from_rotvec(turns).as_matrix(), atol=1e-7)


def test_products_and_inverses(turns):
    others = np.random.default_rng(1).permutation(turns)
    first, second = Rotation.from_rotvec(turns), Rotation.from_rotvec(others)
    product = quat_product(quats_of_turns(turns), quats_of_turns(others))
    assert np.allclose(matrices_of(product), (first * second).as_matrix(), atol=1e-12)
    assert np.allclose(matrices_of(inverse_quats(product)), (first * second).inv().as_matrix(), atol=1e-12)


def test_one_rotation_alone_keeps_its_shape():
    matrix = Rotation.from_rotvec([0.1, -0.2, 0.3]).as_matrix()
    assert quats_of(matrix).shape == (4,)
    assert np.allclose(matrices_of(quats_of(matrix)), matrix)
