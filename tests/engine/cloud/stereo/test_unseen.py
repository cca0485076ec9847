"""Points where no camera looks: they continue what is seen, in its colours, and never stand in the way."""

from __future__ import annotations

import numpy as np
import pytest

from app.lab.synthetic.rigs import looking_at, rig_at
from engine.camera.projection import is_in_picture, project, projection_matrices
from engine.camera.rig import CameraRig
from engine.cloud.stereo.unseen import backdrop, unseen_points

SIZE = (40, 30)
SPACING = 0.1
WALL_Y = 3.0


@pytest.fixture(scope="module")
def rig() -> CameraRig:
    """Three cameras side by side before a wall."""
    centers = np.array([[-1.0, 0.0, 1.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0]])
    made = rig_at(centers, SIZE)
    poses = np.stack([looking_at(center, center + np.array([0.0, 1.0, 0.0])) for center in centers])
    return CameraRig(made.names, poses, made.Ks, made.image_sizes)


@pytest.fixture(scope="module")
def wall(rig: CameraRig) -> tuple[np.ndarray, np.ndarray]:
    """Points and colours of the part of a wall that the cameras see: red on the left, blue on the right."""
    x, z = np.meshgrid(np.arange(-6, 6, SPACING), np.arange(-4, 6, SPACING))
    points = np.column_stack([x.ravel(), np.full(x.size, WALL_Y), z.ravel()])
    seen = np.zeros(len(points), bool)
    for projection in projection_matrices(rig):
        seen |= is_in_picture(*project(points, projection), *SIZE)
    colors = np.where(points[:, :1] < 0, [[0.8, 0.1, 0.1]], [[0.1, 0.1, 0.8]])
    return points[seen], colors[seen]


def depths_of(rig: CameraRig) -> np.ndarray:
    return np.full((len(rig), SIZE[1], SIZE[0]), WALL_Y)


def test_a_wall_goes_on_beyond_the_pictures_in_its_colours(rig: CameraRig, wall: tuple[np.ndarray, np.ndarray]) -> None:
    points, colors, size = unseen_points(*wall, rig, depths_of(rig), SPACING, max_points=1000)
    assert len(points) > 200
    assert np.abs(points[:, 1] - WALL_Y).max() < 0.1
    assert (points[:, 2] > wall[0][:, 2].max()).any()
    assert (points[:, 2] < wall[0][:, 2].min()).any()
    assert points[:, 0].min() < wall[0][:, 0].min() - 5 * SPACING
    assert np.allclose(colors[points[:, 0] < -1.5], [0.8, 0.1, 0.1])
    assert np.allclose(colors[points[:, 0] > 1.5], [0.1, 0.1, 0.8])
    assert size > SPACING


@pytest.mark.slow
def test_there_are_as_few_as_asked_for_and_then_they_are_larger(
    rig: CameraRig, wall: tuple[np.ndarray, np.ndarray]
) -> None:
    many, _, small = unseen_points(*wall, rig, depths_of(rig), SPACING, max_points=1000)
    few, _, large = unseen_points(*wall, rig, depths_of(rig), SPACING, max_points=60)
    assert len(few) <= 60 < len(many)
    assert large > 1.5 * small
    assert len(unseen_points(*wall, rig, depths_of(rig), SPACING, max_points=0)[0]) == 0


def test_nothing_is_put_where_a_camera_looks_through(rig: CameraRig, wall: tuple[np.ndarray, np.ndarray]) -> None:
    points, colors = wall
    # the cloud has a hole although the cameras saw the wall there, and a post stands before it
    is_left = np.hypot(points[:, 0], points[:, 2] - 1) > 0.5
    post = np.column_stack([np.full(20, 0.4), np.full(20, 1.2), np.linspace(0.5, 1.5, 20)])
    cloud = np.concatenate([points[is_left], post])
    tints = np.concatenate([colors[is_left], np.full((20, 3), 0.5)])
    found, _, _ = unseen_points(cloud, tints, rig, depths_of(rig), SPACING, max_points=1000)
    for camera, projection in enumerate(projection_matrices(rig)):
        pixels, depths = project(found, projection)
        rows = is_in_picture(pixels, depths, *SIZE)
        assert (depths[rows] > 0.9 * WALL_Y).all(), camera


def test_a_cloud_behind_all_cameras_is_left_alone(rig: CameraRig) -> None:
    points = np.random.default_rng(0).uniform(-1, 1, (50, 3)) - [0.0, 5.0, 0.0]
    found, colors, _ = unseen_points(points, np.ones((50, 3)), rig, depths_of(rig), SPACING, max_points=100)
    assert found.shape == colors.shape == (0, 3)


def test_the_backdrop_lies_behind_all_that_is_seen(rig: CameraRig, wall: tuple[np.ndarray, np.ndarray]) -> None:
    points, colors, sizes = backdrop(*wall, rig, depths_of(rig))
    assert 0 < len(points) == len(colors) == len(sizes)
    for projection in projection_matrices(rig):
        pixels, depths = project(points, projection)
        rows = is_in_picture(pixels, depths, *SIZE)
        assert rows.any()
        assert (depths[rows] > 0.95 * WALL_Y).all()
    assert (sizes > SPACING).all()
    assert colors[points[:, 0] < -3][:, 0].min() > 0.7
