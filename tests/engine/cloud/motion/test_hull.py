"""Hulls of a sphere seen by a ring of cameras: the silhouettes are known exactly."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from engine.camera.projection import pixel_rays, project, projection_matrices
from engine.camera.rig import CameraRig
from engine.cloud.background.motion_masks import MotionMasks
from engine.cloud.motion.hull import BLOCK, Grid, carve, hull_colors, hull_visibility, surface_rows
from engine.cloud.motion.moving_cloud import build_moving_cloud

WIDTH, HEIGHT = 160, 120


def look_at(center: np.ndarray, target: np.ndarray) -> np.ndarray:
    """World-to-camera pose, OpenCV axes, world z up."""
    forward = (target - center) / np.linalg.norm(target - center)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, -rotation @ center
    return pose


def dome_rig(n_cameras: int = 10) -> CameraRig:
    """Cameras on two rings around the origin, all looking at it."""
    angles = np.linspace(0.0, 2 * np.pi, n_cameras, endpoint=False)
    heights = np.where(np.arange(n_cameras) % 2, 1.5, -0.5)
    centers = np.stack([3 * np.cos(angles), 3 * np.sin(angles), heights], axis=1)
    K = np.array([[150.0, 0.0, WIDTH / 2 + 3.0], [0.0, 152.0, HEIGHT / 2 - 2.0], [0.0, 0.0, 1.0]])
    return CameraRig(
        names=tuple(f"cam{i}" for i in range(n_cameras)),
        world_to_camera=np.stack([look_at(center, np.zeros(3)) for center in centers]),
        Ks=np.repeat(K[None], n_cameras, axis=0),
        image_sizes=np.repeat([[WIDTH, HEIGHT]], n_cameras, axis=0),
    )


def sphere_masks(rig: CameraRig, center: np.ndarray, radius: float) -> np.ndarray:
    """Exact silhouettes: pixels whose ray passes within radius of the centre. [C, H, W] bool"""
    masks = []
    for camera in range(len(rig)):
        rays = pixel_rays(rig.Ks[camera], WIDTH, HEIGHT)
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
        local = rig.world_to_camera[camera, :3, :3] @ center + rig.world_to_camera[camera, :3, 3]
        along = rays @ local
        masks.append(local @ local - along**2 <= radius**2)
    return np.stack(masks)


CENTER, RADIUS = np.array([0.2, -0.1, 0.15]), 0.4


def carve_sphere(rig: CameraRig, masks: np.ndarray, grid: Grid, **options: float) -> np.ndarray:
    settings = {"near": 0.3, "n_misses": 0, "min_hits": 3, **options}
    return carve(masks, projection_matrices(rig), grid, **settings)


def test_hull_contains_the_sphere_and_little_else() -> None:
    rig = dome_rig()
    grid = Grid.over(np.full(3, -1.5), np.full(3, 1.5), 0.05)
    voxels = carve_sphere(rig, sphere_masks(rig, CENTER, RADIUS), grid)
    every = np.stack(np.meshgrid(*(np.arange(n) for n in grid.shape), indexing="ij"), axis=-1).reshape(-1, 3)
    distances = np.linalg.norm(grid.centers(every) - CENTER, axis=1)
    is_hull = np.zeros(tuple(grid.shape), dtype=bool)
    is_hull[tuple(voxels.T)] = True
    is_hull = is_hull[tuple(every.T)]
    assert is_hull[distances < RADIUS].all()
    # 10 views leave corners, and the one pixel tolerance is 2 cm here: nothing further out than a quarter radius
    assert not is_hull[distances > 1.25 * RADIUS + 0.03].any()


@pytest.mark.slow
def test_coarse_blocks_lose_nothing() -> None:
    rig = dome_rig()
    masks = sphere_masks(rig, CENTER, RADIUS)
    grid = Grid.over(np.full(3, -1.2), np.full(3, 1.2), 0.1)
    voxels = carve_sphere(rig, masks, grid)
    every = np.stack(np.meshgrid(*(np.arange(n) for n in grid.shape), indexing="ij"), axis=-1).reshape(-1, 3)
    points = grid.centers(every)
    misses, hits = np.zeros(len(points), int), np.zeros(len(points), int)
    for mask, projection in zip(masks, projection_matrices(rig), strict=True):
        pixels, depths = project(points, projection)
        for i, ((x, y), depth) in enumerate(zip(pixels, depths, strict=True)):
            if depth < 0.3 or not (0 <= x < WIDTH and 0 <= y < HEIGHT):
                continue
            window = mask[max(int(y - 1.0), 0) : int(y + 1.0) + 1, max(int(x - 1.0), 0) : int(x + 1.0) + 1]
            hits[i] += window.any()
            misses[i] += not window.any()
    expected = every[(misses == 0) & (hits >= 3)]
    assert {tuple(v) for v in voxels} == {tuple(v) for v in expected}
    assert len(expected) > BLOCK


def test_one_blind_camera_is_outvoted_only_where_that_is_allowed() -> None:
    rig = dome_rig()
    masks = sphere_masks(rig, CENTER, RADIUS)
    masks[4] = False
    grid = Grid.over(np.full(3, -1.5), np.full(3, 1.5), 0.1)
    assert len(carve_sphere(rig, masks, grid)) == 0
    assert len(carve_sphere(rig, masks, grid, n_misses=1)) > 100


def test_too_few_cameras_make_no_hull() -> None:
    rig = dome_rig()
    grid = Grid.over(np.full(3, -1.5), np.full(3, 1.5), 0.1)
    masks = sphere_masks(rig, CENTER, RADIUS)
    assert len(carve_sphere(rig, masks, grid, min_hits=11)) == 0


def test_surface_of_a_solid_cube_is_its_shell() -> None:
    voxels = np.stack(np.meshgrid(*[np.arange(5)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    is_surface = surface_rows(voxels, Grid.over(np.zeros(3), np.ones(3), 0.1))
    assert is_surface.sum() == 5**3 - 3**3
    assert surface_rows(voxels[:0], Grid.over(np.zeros(3), np.ones(3), 0.1)).shape == (0,)


def test_the_far_side_of_the_hull_is_not_visible() -> None:
    rig = dome_rig()
    masks = sphere_masks(rig, CENTER, RADIUS)
    grid = Grid.over(np.full(3, -1.5), np.full(3, 1.5), 0.04)
    voxels = carve_sphere(rig, masks, grid)
    points = grid.centers(voxels[surface_rows(voxels, grid)])
    _, is_visible = hull_visibility(points, grid.size, masks, projection_matrices(rig), near=0.3)
    to_camera = rig.centers[0] - CENTER
    side = (points - CENTER) @ to_camera / np.linalg.norm(to_camera) / RADIUS
    assert is_visible[0, side > 0.6].mean() > 0.95
    assert not is_visible[0, side < -0.5].any()


def test_colors_are_balanced_and_taken_from_visible_cameras() -> None:
    gains = np.array([[1.0, 1.0, 1.0], [2.0, 1.0, 0.5], [1.0, 1.0, 1.0]])
    pictures = np.stack([np.full((2, 2, 3), 80) * gain for gain in gains]).astype(np.uint8)
    pictures[2] = 255
    pixel = np.array([[0, 1, -1], [0, 1, -1], [0, -1, -1]])
    is_visible = np.array([[True, False, False], [True, False, False], [False, False, False]])
    colors = hull_colors(pictures, pixel, is_visible, gains)
    assert np.allclose(colors[:2], 80.0)
    assert np.isnan(colors[2]).all()


@pytest.mark.slow
def test_moving_cloud_follows_the_sphere_through_the_clip() -> None:
    rig = dome_rig()
    positions = [CENTER + np.array([0.3 * m, 0.0, 0.0]) for m in range(3)]
    flags = np.stack([sphere_masks(rig, position, RADIUS) for position in positions])
    masks = MotionMasks.of(flags)
    gains = np.ones((len(rig), 3))
    lines: list[str] = []

    def picture(row: int, frame_in_clip: int) -> np.ndarray:
        return np.where(flags[frame_in_clip, row][..., None], [200, 100, 50], [0, 255, 0]).astype(np.uint8)

    bounds: dict[str, Any] = {"bounds_min": np.full(3, -1.5), "bounds_max": np.full(3, 1.8)}
    cloud = build_moving_cloud(picture, masks, rig, gains, **bounds, max_points=3000, report=lines.append)
    assert len(lines) == 2
    assert 500 < len(cloud.points) <= 3150
    assert cloud.presence.any(1).all()
    for m, position in enumerate(positions):
        distances = np.linalg.norm(cloud.points[cloud.presence[:, m]] - position, axis=1)
        assert np.median(np.abs(distances - RADIUS)) < 1.5 * cloud.spacing
    # a pixel of green may shine through at the silhouette, but a median over cameras keeps it out
    assert np.median(np.abs(cloud.colors * 255 - [200, 100, 50])) < 2.0
    again = build_moving_cloud(picture, masks, rig, gains, **bounds, max_points=3000, report=lines.append)
    assert np.array_equal(cloud.points, again.points)
    assert np.array_equal(cloud.presence, again.presence)
    assert np.array_equal(cloud.colors, again.colors)


@pytest.mark.slow
def test_points_that_travel_stay_on_the_sphere() -> None:
    rig = dome_rig()
    positions = [CENTER + np.array([0.05 * m, 0.0, 0.02 * m]) for m in range(4)]
    flags = np.stack([sphere_masks(rig, position, RADIUS) for position in positions])

    def picture(row: int, frame_in_clip: int) -> np.ndarray:
        return np.where(flags[frame_in_clip, row][..., None], [200, 100, 50], [0, 255, 0]).astype(np.uint8)

    bounds: dict[str, Any] = {"bounds_min": np.full(3, -1.5), "bounds_max": np.full(3, 1.8)}
    still, cloud, again = (
        build_moving_cloud(
            picture,
            MotionMasks.of(flags),
            rig,
            np.ones((len(rig), 3)),
            **bounds,
            travels=travels,
            report=lambda line: None,
        )
        for travels in (False, True, True)
    )
    assert still.motion is None
    assert cloud.motion is not None
    assert len(cloud.points) < 0.7 * len(still.points)
    births, velocities, accelerations = cloud.motion
    for m, position in enumerate(positions):
        since = (m - births)[:, None]
        here = (cloud.points + since * (velocities + since * accelerations))[cloud.presence[:, m]]
        assert len(here) > 0.8 * still.presence[:, m].sum()
        assert np.median(np.abs(np.linalg.norm(here - position, axis=1) - RADIUS)) < 1.5 * cloud.spacing
    assert np.median(np.abs(cloud.colors * 255 - [200, 100, 50])) < 2.0
    for name in ("points", "colors", "presence"):
        assert np.array_equal(getattr(cloud, name), getattr(again, name))
    for ours, theirs in zip(cloud.motion, again.motion or (), strict=True):
        assert np.array_equal(ours, theirs)


@pytest.mark.parametrize("n_frames", [1, 2])
def test_nothing_moving_gives_an_empty_cloud(n_frames: int) -> None:
    rig = dome_rig(4)
    lines: list[str] = []
    cloud = build_moving_cloud(
        lambda row, frame_in_clip: np.zeros((HEIGHT, WIDTH, 3), np.uint8),
        MotionMasks(n_frames, 4, HEIGHT, WIDTH),
        rig,
        np.ones((4, 3)),
        bounds_min=-np.ones(3),
        bounds_max=np.ones(3),
        report=lines.append,
    )
    assert cloud.points.shape == (0, 3)
    assert cloud.presence.shape == (0, n_frames)
    assert "nothing moves" in lines[0]
