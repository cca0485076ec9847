"""What one sees along a ray, checked against plain sums and against the rasterizer's depth."""

from typing import Any

import numpy as np
import pytest
import torch

from app.playback.modes.arrays import GaussianArrays
from app.playback.views.pointing import pixel_ray, seen_point
from engine.backends.table import backend_called
from engine.raster import Gaussians, rasterize

FORWARD = np.array([0.0, 0.0, 1.0])
ORIGIN = np.zeros(3)


def gaussians(
    means: Any,
    *,
    scales: Any = 0.1,
    opacities: Any = 0.95,
    quats: Any = (1.0, 0.0, 0.0, 0.0),
    near_plane: float = 0.01,
) -> GaussianArrays:
    means = np.array(means, np.float32).reshape(-1, 3)
    n = len(means)
    return GaussianArrays(
        means=means,
        quats=np.broadcast_to(np.array(quats, np.float32), (n, 4)).copy(),
        scales=np.broadcast_to(np.array(scales, np.float32), (n, 3)).copy(),
        opacities=np.broadcast_to(np.array(opacities, np.float32), (n,)).copy(),
        colors=np.full((n, 3), 0.5, np.float32),
        key="made up",
        near_plane=near_plane,
    )


def seen_depth(arrays: GaussianArrays) -> float | None:
    point = seen_point(arrays, ORIGIN, FORWARD)
    return None if point is None else float(point[2])


def test_the_nearest_of_two_opaque_ones_is_seen():
    assert seen_depth(gaussians([[0, 0, 4], [0, 0, 2]])) == pytest.approx(2.0)


def test_one_sees_through_what_is_faint_until_half_of_the_light_is_gone():
    arrays = gaussians([[0, 0, 1], [0, 0, 2], [0, 0, 3], [0, 0, 4]], opacities=[0.2, 0.2, 0.3, 0.9])
    # 0.8, 0.64, 0.448 of the light is left behind the first three
    assert seen_depth(arrays) == pytest.approx(3.0)


def test_nothing_is_seen_beside_behind_before_the_near_plane_or_where_too_little_is():
    assert seen_depth(gaussians(np.zeros((0, 3)))) is None
    assert seen_depth(gaussians([[1, 0, 2]])) is None
    assert seen_depth(gaussians([[0, 0, -2]])) is None
    assert seen_depth(gaussians([[0, 0, 2]], opacities=0.4)) is None
    assert seen_depth(gaussians([[0, 0, 0.5], [0, 0, 2]], near_plane=1.0)) == pytest.approx(2.0)


def test_what_is_no_number_is_passed_over():
    arrays = gaussians([[np.nan, 0, 1], [0, 0, 2], [0, 0, 1]])
    arrays.quats[2] = 0.0
    assert seen_depth(arrays) == pytest.approx(2.0)


def test_a_tilted_disc_is_hit_where_the_ray_meets_it():
    """A wide flat disc through (0, 0, 2), turned by 45 degrees about y: at x = 0.5 its plane lies at z = 2.5 or 1.5."""
    half = np.deg2rad(45.0) / 2
    disc = gaussians([[0, 0, 2]], scales=(1.0, 1.0, 1e-3), quats=(np.cos(half), 0.0, np.sin(half), 0.0))
    x_axis = np.array([np.cos(2 * half), 0.0, -np.sin(2 * half)])  # of the disc, in the world
    point = seen_point(disc, np.array([0.5, 0.0, 0.0]), FORWARD)
    assert point is not None
    assert point[2] == pytest.approx(2.0 + 0.5 * x_axis[2] / x_axis[0], abs=1e-4)


def test_pixel_and_ray_belong_together():
    rng = np.random.default_rng(3)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation * np.linalg.det(rotation), rng.normal(size=3)
    K = np.array([[80.0, 0.0, 31.0], [0.0, 70.0, 22.0], [0.0, 0.0, 1.0]])
    origin, direction = pixel_ray(pose, K, 12.5, 40.25)
    for depth in (0.5, 3.0):
        in_camera = pose[:3, :3] @ (origin + depth * direction) + pose[:3, 3]
        np.testing.assert_allclose((K @ in_camera)[:2] / in_camera[2], [12.5, 40.25], atol=1e-9)
    assert np.linalg.norm(direction) == pytest.approx(1.0)


def test_on_a_closed_surface_it_is_the_depth_that_the_rasterizer_draws():
    """A dense ball of small opaque Gaussians: the rasterizer's mean depth is that of its front, give or take one
    spacing, since it blends what lies within a Gaussian's thickness."""
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(6000, 3))
    means = directions / np.linalg.norm(directions, axis=1, keepdims=True) + np.array([0.0, 0.0, 4.0])
    arrays = gaussians(means, scales=0.05)
    K = np.array([[60.0, 0.0, 32.0], [0.0, 60.0, 24.0], [0.0, 0.0, 1.0]])
    values = [torch.from_numpy(getattr(arrays, name)) for name in ("means", "quats", "scales", "opacities", "colors")]
    viewmat, intrinsics = torch.eye(4)[None], torch.from_numpy(K).float()[None]
    drawn = rasterize(Gaussians(*values), viewmat, intrinsics, 64, 48, want_depth=True, backend=backend_called("cpu"))
    assert drawn.expected_depth is not None
    for x, y in ((32, 24), (25, 20), (40, 28), (32, 15)):
        origin, direction = pixel_ray(np.eye(4), K, x + 0.5, y + 0.5)
        point = seen_point(arrays, origin, direction)
        assert point is not None
        assert point[2] == pytest.approx(float(drawn.expected_depth[0, y, x, 0]), abs=0.05)
    corner = pixel_ray(np.eye(4), K, 2.0, 2.0)
    assert seen_point(arrays, *corner) is None
    assert float(drawn.alpha[0, 2, 2, 0]) == 0.0
