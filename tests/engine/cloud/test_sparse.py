"""Triangulation in a child process: failures cost the points, never the job, and pycolmap stays out of this process."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from engine.capture.rig import CameraRig
from engine.cloud.sparse import triangulate


def wall_views(n_cameras: int = 4) -> tuple[np.ndarray, CameraRig]:
    """A textured wall at z = 4 seen by cameras side by side: exact pixel shifts. [C, 200, 240, 3] uint8"""
    rng = np.random.default_rng(0)
    wall = np.kron(rng.uniform(0, 255, (50, 110, 3)), np.ones((4, 4, 1)))
    step_px = 20  # baseline 0.4 at depth 4 and focal length 200
    pictures = np.stack([wall[:, i * step_px : i * step_px + 240] for i in range(n_cameras)]).astype(np.uint8)
    poses = np.repeat(np.eye(4)[None], n_cameras, axis=0)
    poses[:, 0, 3] = -0.4 * np.arange(n_cameras)
    K = np.array([[200.0, 0.0, 120.0], [0.0, 200.0, 100.0], [0.0, 0.0, 1.0]])
    names = tuple(f"view{i}" for i in range(n_cameras))
    sizes = np.repeat([[240, 200]], n_cameras, axis=0)
    return pictures, CameraRig(names, poses, np.repeat(K[None], n_cameras, axis=0), sizes)


def test_points_of_a_textured_wall_lie_on_it() -> None:
    pytest.importorskip("PIL")
    pictures, rig = wall_views()
    lines: list[str] = []
    sparse = triangulate(pictures, rig, report=lines.append)
    assert "pycolmap" not in sys.modules
    if len(sparse.points) == 0:
        pytest.skip(f"the child could not triangulate here: {lines[0]}")
    # 0.3 px of matching error over a 20 to 60 px shift is 0.5 to 1.5 % of the depth
    assert np.median(np.abs(sparse.points[:, 2] - 4.0)) < 0.06
    assert sparse.colors.min() >= 0
    assert sparse.colors.max() <= 1
    assert (sparse.errors < 2.0).all()


def test_a_flat_picture_gives_no_points_and_says_so() -> None:
    pictures, rig = wall_views()
    lines: list[str] = []
    sparse = triangulate(np.full_like(pictures, 128), rig, report=lines.append)
    assert sparse.points.shape == (0, 3)
    assert len(lines) == 1
    assert lines[0].startswith("Sparse points:")


def test_a_child_over_its_time_is_stopped() -> None:
    pictures, rig = wall_views()
    lines: list[str] = []
    sparse = triangulate(pictures, rig, report=lines.append, time_limit_s=0.05)
    assert len(sparse.points) == 0
    assert "longer than" in lines[0]
