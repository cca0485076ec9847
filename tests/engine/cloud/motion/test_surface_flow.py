"""Motion of a textured ball that a ring of cameras films, against the truth."""

from __future__ import annotations

import numpy as np
import pytest

from engine.camera.projection import image_jacobians, pixel_rays, project, projection_matrices
from engine.cloud.motion.hull import hull_visibility
from engine.cloud.motion.surface_flow import surface_flow
from tests.engine.cloud.motion.test_hull import HEIGHT, WIDTH, dome_rig

RADIUS = 0.5
STEP = np.array([0.03, -0.02, 0.025])


def filmed(rig, center: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pictures [C, H, W, 3] uint8 and silhouettes [C, H, W] of a ball whose texture goes with it."""
    pictures, masks = [], []
    for pose, K in zip(rig.world_to_camera, rig.Ks, strict=True):
        rays = pixel_rays(K, WIDTH, HEIGHT)
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
        middle = pose[:3, :3] @ center + pose[:3, 3]
        along = rays @ middle
        inside = RADIUS**2 - (middle @ middle - along**2)
        is_hit = inside > 0
        points = rays * (along - np.sqrt(np.maximum(inside, 0)))[..., None] - middle
        local = points @ pose[:3, :3]  # in the ball's own axes, which are the world's
        shade = 127 + 60 * np.sin(25 * local[..., 0]) * np.sin(23 * local[..., 1]) + 50 * np.sin(27 * local[..., 2])
        pictures.append(np.where(is_hit, np.clip(shade, 0, 255), 20)[..., None].repeat(3, -1).astype(np.uint8))
        masks.append(is_hit)
    return np.stack(pictures), np.stack(masks)


@pytest.fixture(scope="module")
def seen():
    rig = dome_rig(12)
    (before, masks), (after, masks_after) = filmed(rig, np.zeros(3)), filmed(rig, STEP)
    directions = np.random.default_rng(0).normal(size=(1500, 3))
    points = RADIUS * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    pixel, is_visible = hull_visibility(points, 0.04, masks, projection_matrices(rig), near=0.3)
    return points, pixel, is_visible, (before, after), masks | masks_after, projection_matrices(rig)


def test_a_ball_that_moves_moves_as_a_whole(seen):
    found = surface_flow(*seen)
    off = np.linalg.norm(found - STEP, axis=1)
    assert np.median(off) < 0.1 * np.linalg.norm(STEP)
    assert np.percentile(off, 95) < 0.4 * np.linalg.norm(STEP)  # dark poles and rims say little


def test_nothing_moves_between_equal_pictures(seen):
    points, pixel, is_visible, (before, _), masks, projections = seen
    assert np.abs(surface_flow(points, pixel, is_visible, (before, before), masks, projections)).max() < 1e-3


def test_who_is_not_seen_goes_with_the_others_and_nobody_seen_stays(seen):
    points, pixel, is_visible, pictures, masks, projections = seen
    half = is_visible.copy()
    half[:, ::2] = False
    found = surface_flow(points, pixel, half, pictures, masks, projections)
    assert np.median(np.linalg.norm(found[::2] - STEP, axis=1)) < 0.15 * np.linalg.norm(STEP)
    nobody = surface_flow(points, pixel, np.zeros_like(is_visible), pictures, masks, projections)
    assert not nobody.any()


def test_a_camera_whose_pictures_jump_is_outvoted(seen):
    points, pixel, is_visible, (before, after), masks, projections = seen
    after = after.copy()
    after[3] = np.roll(after[3], 9, axis=1)
    found = surface_flow(points, pixel, is_visible, (before, after), masks, projections)
    assert np.median(np.linalg.norm(found - STEP, axis=1)) < 0.15 * np.linalg.norm(STEP)


def test_jacobians_against_differences():
    projection = projection_matrices(dome_rig(4))[1]
    points = np.random.default_rng(1).uniform(-0.5, 0.5, (20, 3))
    found, h = image_jacobians(points, projection), 1e-6
    for axis in range(3):
        ahead, behind = (project(points + side * h * np.eye(3)[axis], projection)[0] for side in (1, -1))
        np.testing.assert_allclose(found[..., axis], (ahead - behind) / (2 * h), rtol=1e-5, atol=1e-4)
