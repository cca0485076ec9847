"""What cameras do not see, in all that is found in pictures before a training: it says nothing of the scene."""

from __future__ import annotations

import numpy as np
import pytest

from engine.camera.projection import project, projection_matrices
from engine.cloud.background.background import estimate_background
from engine.cloud.background.exposure import Exposure
from engine.cloud.background.masks import motion_mask
from engine.cloud.background.recheck import recheck_background
from engine.cloud.motion.hull import Grid, carve
from tests.engine.cloud.motion.test_hull import CENTER, HEIGHT, RADIUS, WIDTH, dome_rig, sphere_masks

SIZE = (90, 160)


def half_seen() -> tuple[np.ndarray, np.ndarray]:
    """Ten noisy frames of a wall that are black in the left part, and what is valid of them."""
    random = np.random.default_rng(5)
    y, x = np.mgrid[: SIZE[0], : SIZE[1]]
    wall = 90 + 60 * np.sin(x / 9.0) * np.cos(y / 7.0)
    frames = wall[None, ..., None] + random.normal(0, 3, (10, *SIZE, 3))
    is_valid = x >= 100
    frames = np.clip(frames, 20, 230).astype(np.uint8)
    frames[:, ~is_valid] = 0
    return frames, is_valid


def test_backgrounds_are_stable_in_valid_pixels_only_and_the_same_there() -> None:
    frames, is_valid = half_seen()
    found = estimate_background(frames, is_valid)
    alone = estimate_background(np.ascontiguousarray(frames[:, :, 100:]))
    assert not found.is_stable[~is_valid].any()
    assert found.is_stable[is_valid].all()
    assert np.array_equal(found.image[:, 100:], alone.image)
    few = estimate_background(frames[:2], is_valid)
    assert not few.is_stable[~is_valid].any()


def test_motion_is_found_by_the_noise_of_valid_pixels_and_nowhere_else() -> None:
    random = np.random.default_rng(6)
    frames, is_valid = half_seen()
    background = frames[0].copy()
    noisy = background.astype(np.float64) + np.where(is_valid[..., None], random.normal(0, 22, (*SIZE, 3)), 0)
    noisy[40:60, 100:125] += 60
    frame = np.clip(noisy, 0, 255).astype(np.uint8)
    mask = motion_mask(frame, background, is_valid=is_valid)
    alone = motion_mask(np.ascontiguousarray(frame[:, 100:]), np.ascontiguousarray(background[:, 100:]), threshold=None)
    assert not mask[~is_valid].any()
    assert mask[45:55, 104:120].all()
    assert alone.mean() < 0.5
    assert mask[:, 130:].mean() < 0.05  # by the noise of all pixels, half of it black, most of these would move
    assert motion_mask(frame, background)[:, 130:].mean() > 2 * max(mask[:, 130:].mean(), 0.05)


def test_exposure_is_that_of_valid_pixels() -> None:
    frames, _ = half_seen()
    brighter = np.clip(1.2 * frames[:3].astype(np.float64) + 0.5, 0, 255).astype(np.uint8)
    gains = Exposure.of_background(frames[3]).gains_of(brighter)
    assert gains == pytest.approx(1.2, rel=0.02)


def test_nothing_is_put_where_a_camera_sees_nothing() -> None:
    frames, is_valid = half_seen()
    background, render = frames[0], np.full((*SIZE, 3), 0.9, np.float32)
    is_stable = is_valid.copy()
    is_stable[30:70, 110:150] = False  # somebody stood there
    corrected = recheck_background(background, is_stable, render, frames, is_valid)
    assert (corrected[~is_valid] == 0).all()
    assert (corrected[40:60, 120:140] > 200).all()  # no frame supports the render: it is taken itself


def test_hulls_ask_only_cameras_that_see_the_place() -> None:
    rig = dome_rig()
    masks, projections = sphere_masks(rig, CENTER, RADIUS), projection_matrices(rig)
    grid = Grid.over(np.full(3, -0.8), np.full(3, 0.9), 0.04)
    options = {"near": 0.3, "n_misses": 0, "min_hits": 3}
    whole = carve(masks, projections, grid, **options)
    is_valid = np.ones((len(rig), HEIGHT, WIDTH), bool)
    assert np.array_equal(carve(masks, projections, grid, is_valid=is_valid, **options), whole)

    is_valid[:3, :, : WIDTH // 2] = False  # three cameras lost a half, and with it what they saw of the sphere there
    seen = masks & is_valid
    assert len(carve(seen, projections, grid, **options)) < 0.8 * len(whole)  # taken for empty, it carves
    kept = carve(seen, projections, grid, is_valid=is_valid, **options)
    assert {tuple(voxel) for voxel in whole} <= {tuple(voxel) for voxel in kept}

    is_valid[:] = False
    assert len(carve(masks & is_valid, projections, grid, is_valid=is_valid, **options)) == 0  # nor does it support


@pytest.mark.slow
def test_no_point_of_the_static_cloud_comes_from_pixels_that_are_not_valid() -> None:
    from engine.assets import asset_path
    from engine.capture.capture import open_capture
    from engine.cloud.stereo.static_cloud import build_static_cloud

    capture = open_capture(asset_path("sample"), scale=0.5)
    cameras = list(range(0, 20, 2))
    rig = capture.rig.subset(cameras)
    pictures = np.stack([capture.frame(camera, 0) for camera in cameras])
    is_valid = np.ones(pictures.shape[:3], bool)
    is_valid[:, :, :40] = is_valid[:, :24] = False
    pictures[~is_valid] = 0
    cloud = build_static_cloud(
        pictures, is_valid, rig, is_valid=is_valid, max_points=3000, color="off", report=lambda _: None
    )
    assert len(cloud.points) > 500
    assert np.median(cloud.colors) > 0.15
    assert (cloud.colors.max(1) < 0.03).mean() < 0.002  # nothing black: no wall of what no camera saw
    is_seen = np.zeros(len(cloud.points), bool)
    for camera, projection in enumerate(projection_matrices(rig)):
        pixels, depths = project(cloud.points.astype(np.float64), projection)
        x, y = np.floor(pixels).astype(int).T
        inside = (depths > 0) & (x >= 0) & (y >= 0) & (x < 160) & (y < 120)
        is_seen[inside] |= is_valid[camera, y[inside], x[inside]]
    is_measured = cloud.sizes <= 1.001 * cloud.spacing  # the others continue surfaces to where no camera looks
    assert is_measured.mean() > 0.7
    assert is_seen[is_measured].mean() > 0.995
