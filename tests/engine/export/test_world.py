"""Where scenes lie in files: turned, scaled, and back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from engine.export.splats import Splats
from engine.export.world import AXES, FileWorld, rotation_between, world
from tests.engine.export.scenes import angles_deg, chance_splats


def covariances(splats):
    rotations = Rotation.from_quat(splats.quats[:, [1, 2, 3, 0]].astype(float)).as_matrix()
    return np.einsum("nij,nj,nkj->nik", rotations, splats.scales.astype(float) ** 2, rotations)


@pytest.mark.parametrize("up", sorted(AXES))
@pytest.mark.parametrize("scene_up", [(0.0, -1.0, 0.0), (0.0, 0.0, 1.0), (0.3, -0.9, 0.2), (-1.0, 0.0, 0.0)])
def test_up_is_where_it_was_asked_for_and_shapes_turn_along(up, scene_up):
    splats = chance_splats(50)
    placement = world(np.array(scene_up), up=up, scale=2.5)
    np.testing.assert_allclose(placement.up, AXES[up], atol=1e-12)
    R = placement.rotation
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)
    placed = placement.placed(splats)
    np.testing.assert_allclose(placed.means, 2.5 * splats.means @ R.T, atol=1e-5)
    np.testing.assert_allclose(covariances(placed), 6.25 * R @ covariances(splats) @ R.T, rtol=1e-3, atol=1e-8)
    back = placement.returned(placed)
    np.testing.assert_allclose(back.means, splats.means, atol=1e-5)
    np.testing.assert_allclose(back.scales, splats.scales, rtol=1e-5)
    assert angles_deg(back.quats, splats.quats).max() < 0.1


def test_nothing_asked_for_changes_nothing():
    splats = chance_splats(5)
    placement = world(np.array([0.1, -0.9, 0.0]))
    assert placement.placed(splats).means is splats.means
    assert placement.text == "axes as in the capture, scale as in the capture"
    assert FileWorld().placed(splats).quats is splats.quats


def test_rub_reverses_y_and_z():
    splats = chance_splats(30)
    placement = world(np.array([0.0, -1.0, 0.0]), is_rub=True)
    placed = placement.placed(splats)
    np.testing.assert_allclose(placed.means, splats.means * [1, -1, -1])
    # what Niantic's library does to a rotation; it differs by a half turn of the Gaussian itself, which looks the same
    flipped = replace(splats, quats=splats.quats * np.array([1, 1, -1, -1], np.float32))
    np.testing.assert_allclose(covariances(placed), covariances(flipped), rtol=1e-3, atol=1e-8)
    np.testing.assert_allclose(placement.up, (0.0, 1.0, 0.0), atol=1e-12)
    assert "y and z reversed" in placement.text


def test_gaussians_turn_with_the_world():
    random = np.random.default_rng(1)
    a, b = (Rotation.from_quat(random.standard_normal(4)) for _ in range(2))
    (x, y, z, w), expected = b.as_quat(), (a * b).as_quat()[[3, 0, 1, 2]]
    splats = Splats.from_arrays(np.zeros(3), np.array([[w, x, y, z]]), np.ones((1, 3)), np.ones(1), np.zeros((1, 3)))
    turned = FileWorld(rotation=a.as_matrix()).placed(splats).quats
    assert turned.dtype == np.float32
    np.testing.assert_allclose(turned[0] * np.sign(turned[0] @ expected), expected, atol=1e-6)


def test_directions_that_are_the_same_need_no_turn():
    direction = np.random.default_rng(1).standard_normal(3)
    np.testing.assert_allclose(rotation_between(direction, direction), np.eye(3), atol=1e-12)


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan, np.inf])
def test_a_scale_is_a_positive_number(scale):
    with pytest.raises(ValueError, match="scale"):
        world(np.array([0.0, 1.0, 0.0]), scale=scale)


def test_a_direction_needs_a_length():
    with pytest.raises(ValueError, match="length"):
        rotation_between(np.zeros(3), np.array([0.0, 1.0, 0.0]))
