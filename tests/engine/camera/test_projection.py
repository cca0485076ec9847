"""World points to pixels and back."""

import numpy as np
import pytest

from app.lab.synthetic.rigs import make_rig
from engine.camera.projection import (
    is_in_picture,
    pinhole_K,
    pixel_rays,
    project,
    projection_matrices,
    unproject,
    vertical_fov,
)

RIG = make_rig(3, (8, 6))


@pytest.mark.parametrize("camera", range(3))
def test_a_depth_picture_comes_back_to_its_own_pixels(camera, rng):
    depths = rng.uniform(1.0, 4.0, (6, 8))
    points = unproject(depths, RIG.Ks[camera], RIG.world_to_camera[camera]).reshape(-1, 3)
    pixels, found = project(points, projection_matrices(RIG)[camera])
    x, y = np.meshgrid(np.arange(8) + 0.5, np.arange(6) + 0.5)
    assert np.allclose(pixels, np.stack([x, y], -1).reshape(-1, 2), atol=1e-9)
    assert np.allclose(found, depths.ravel(), atol=1e-9)


def test_a_ray_through_the_principal_point_is_the_viewing_direction():
    K = np.array([[10.0, 0.0, 2.5], [0.0, 10.0, 1.5], [0.0, 0.0, 1.0]])
    assert np.allclose(pixel_rays(K, 4, 3)[1, 2], [0.0, 0.0, 1.0])


def test_a_point_behind_the_camera_has_finite_pixels_and_is_not_in_the_picture():
    behind = RIG.centers[0] - RIG.forwards[0]
    beside = RIG.centers[0] + np.cross(RIG.forwards[0], [0.0, 0.0, 1.0])
    pixels, depths = project(np.stack([behind, beside, RIG.centers[0]]), projection_matrices(RIG)[0])
    assert np.isfinite(pixels).all()
    assert depths[0] == pytest.approx(-1.0)
    assert not is_in_picture(pixels, depths, 8, 6)[[0, 2]].any()


def test_the_picture_begins_at_zero_and_ends_before_its_size():
    pixels = np.array([[0.0, 0.0], [7.999, 5.999], [8.0, 3.0], [3.0, 6.0], [-0.001, 3.0]])
    assert is_in_picture(pixels, np.ones(5), 8, 6).tolist() == [True, True, False, False, False]


def test_a_lens_of_a_field_of_view_has_that_field_of_view():
    K = pinhole_K(0.9, (160, 90))
    assert vertical_fov(K[1, 1], 90.0) == pytest.approx(0.9)
    assert K[0, 0] == K[1, 1]
    top, bottom = project(np.array([[0.0, -np.tan(0.45), 1.0], [0.0, np.tan(0.45), 1.0]]), K @ np.eye(3, 4))[0]
    np.testing.assert_allclose([top, bottom], [[80.0, 0.0], [80.0, 90.0]], atol=1e-12)
