"""World to camera to pixels and back, against matrices written out."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from engine.camera.projection import camera_center, focal_px, project, to_camera, to_pixels, to_world, unproject

K = np.array([[210.0, 0.0, 80.5], [0.0, 190.0, 61.0], [0.0, 0.0, 1.0]])


@pytest.fixture
def pose() -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler("xyz", [0.3, -0.7, 0.2]).as_matrix()
    matrix[:3, 3] = [0.4, -0.1, 2.5]
    return matrix


def test_points_go_to_the_camera_and_back(pose: np.ndarray, rng: np.random.Generator) -> None:
    points = rng.normal(size=(50, 3))
    in_camera = to_camera(points, pose)
    expected = (pose @ np.concatenate([points, np.ones((50, 1))], axis=1).T).T[:, :3]
    np.testing.assert_allclose(in_camera, expected, atol=1e-12)
    np.testing.assert_allclose(to_world(in_camera, pose), points, atol=1e-12)


def test_the_centre_of_a_camera_is_its_origin(pose: np.ndarray) -> None:
    np.testing.assert_allclose(to_camera(camera_center(pose)[None], pose), np.zeros((1, 3)), atol=1e-12)


def test_pixels_are_those_of_the_projection_matrix(pose: np.ndarray, rng: np.random.Generator) -> None:
    points = to_world(rng.uniform([-1, -1, 0.5], [1, 1, 4], size=(40, 3)), pose)
    pixels, depths = project(points, K @ pose[:3])
    in_camera = to_camera(points, pose)
    np.testing.assert_allclose(to_pixels(in_camera, K), pixels, rtol=1e-9)
    np.testing.assert_allclose(in_camera[:, 2], depths, rtol=1e-9)


def test_pixels_behind_a_camera_stay_finite() -> None:
    behind = np.array([[0.1, 0.2, -1.0], [0.0, 0.0, 0.0], [1e6, -1e6, 1e-30]])
    assert np.isfinite(to_pixels(behind, K)).all()


def test_a_depth_picture_comes_back_through_its_pixels(pose: np.ndarray, rng: np.random.Generator) -> None:
    depths = rng.uniform(0.5, 3.0, size=(4, 6))
    points = unproject(depths, K, pose).reshape(-1, 3)
    in_camera = to_camera(points, pose)
    columns, rows = np.meshgrid(np.arange(6) + 0.5, np.arange(4) + 0.5)
    np.testing.assert_allclose(to_pixels(in_camera, K), np.stack([columns, rows], -1).reshape(-1, 2), atol=1e-9)
    np.testing.assert_allclose(in_camera[:, 2], depths.ravel(), rtol=1e-12)


def test_one_focal_length_is_the_geometric_mean() -> None:
    np.testing.assert_allclose(focal_px(np.stack([K, 4 * K])), np.sqrt(210.0 * 190.0) * np.array([1.0, 4.0]))
