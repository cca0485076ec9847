"""The whole way from pictures to cameras, by the real child process: a room corner whose cameras are known."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.calibration.calibrate import calibrate
from engine.calibration.options import CalibrationOptions, KnownDistance
from engine.progress import Progress
from tests.engine.calibration.made_rigs import looking_at

WIDTH, HEIGHT, FOCAL = 320, 240, 300.0
RAYS = 2


@pytest.fixture
def scratch(tmp_path, monkeypatch) -> Path:
    """The temporary folder of this test."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


@pytest.mark.slow
def test_cameras_of_a_room_corner_are_found(tmp_path: Path, scratch: Path) -> None:
    folder = tmp_path / "videos"
    poses = write_corner(folder)
    told: list[Progress] = []
    options = CalibrationOptions(distance=KnownDistance("cam1", "cam10", distance(poses, 0, 5)))
    found = calibrate(folder, options, report=told.append)
    assert not found.missing
    assert found.found.rig.names == ("cam1", "cam2", "cam3", "cam4", "cam9", "cam10")
    assert not any(found.found.doubts)
    assert found.found.explained_shares.min() > 0.9
    assert found.found.is_metric
    assert found.found.up == "floor"
    assert np.median(found.found.camera_errors_px) < 0.5
    focals = found.found.rig.Ks[:, 0, 0]
    np.testing.assert_allclose(focals, FOCAL, rtol=0.03)
    for a, b in ((0, 1), (1, 4), (2, 5)):
        mine = found.found.rig.world_to_camera
        turned = mine[a, :3, :3] @ mine[b, :3, :3].T @ (poses[a, :3, :3] @ poses[b, :3, :3].T).T
        assert np.degrees(np.arccos(np.clip((np.trace(turned) - 1) / 2, -1, 1))) < 0.6
        assert distance(mine, a, b) == pytest.approx(distance(poses, a, b), rel=0.03)
    heights = found.found.rig.centers[:, 2]
    np.testing.assert_allclose(heights, 1.2, atol=0.1)  # above the floor, in metres
    assert [progress.done for progress in told] == sorted(progress.done for progress in told)
    assert not list(scratch.iterdir())


def distance(poses: np.ndarray, a: int, b: int) -> float:
    """Between the centres of two cameras."""
    centers = [-poses[row, :3, :3].T @ poses[row, :3, 3] for row in (a, b)]
    return float(np.linalg.norm(centers[0] - centers[1]))


def write_corner(folder: Path) -> np.ndarray:
    """One image per camera of a floor (z = 0) and two walls with random prints; poses [6, 4, 4]."""
    generator = np.random.default_rng(0)
    prints = [
        np.kron(generator.uniform(20, 235, (45, 45, 3)), np.ones((8, 8, 1))) for _ in range(3)
    ]  # patches of 12 cm on 5.4 m
    angles = np.radians(np.linspace(-110, -160, 6))
    poses = np.array(
        [looking_at(np.array([3 * np.cos(a), 3 * np.sin(a), 1.2]), np.array([0.4, 0.4, 0.6])) for a in angles]
    )
    for name, pose in zip((1, 2, 3, 4, 9, 10), poses, strict=True):
        (folder / f"cam{name}").mkdir(parents=True)
        Image.fromarray(corner_picture(pose, prints)).save(folder / f"cam{name}" / "000.png")
    return poses


def corner_picture(pose: np.ndarray, prints: list[np.ndarray]) -> np.ndarray:
    """What a camera sees. [H, W, 3] uint8"""
    x, y = np.meshgrid((np.arange(WIDTH * RAYS) + 0.5) / RAYS, (np.arange(HEIGHT * RAYS) + 0.5) / RAYS)
    rays = np.stack([(x - WIDTH / 2) / FOCAL, (y - HEIGHT / 2) / FOCAL, np.ones_like(x)], axis=-1) @ pose[:3, :3]
    center = -pose[:3, :3].T @ pose[:3, 3]
    color, nearest = np.zeros(rays.shape), np.full(x.shape, np.inf)
    for axis, height, texture in ((2, 0.0, prints[0]), (1, 1.6, prints[1]), (0, 1.6, prints[2])):
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = (height - center[axis]) / rays[..., axis]
        hits = center + rays * reach[..., None]
        across = np.delete(hits, axis, axis=-1)
        places = np.clip(np.nan_to_num((across + 3.6) / 0.015), 0, 359).astype(int)
        is_seen = (reach > 0) & (reach < nearest)
        color[is_seen] = texture[places[..., 0], places[..., 1]][is_seen]
        nearest[is_seen] = reach[is_seen]
    mean = color.reshape(HEIGHT, RAYS, WIDTH, RAYS, 3).mean(axis=(1, 3))
    return (mean + 0.5).astype(np.uint8)
