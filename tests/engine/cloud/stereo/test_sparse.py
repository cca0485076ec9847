"""Triangulation in a child process: failures cost the points, never the job, and pycolmap stays out of this process."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest

from engine.camera.rig import CameraRig
from engine.children import folder as folders
from engine.children import process
from engine.cloud.stereo.sparse import triangulate
from engine.features import child as child_process


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


@pytest.mark.slow
def test_points_of_a_textured_wall_lie_on_it() -> None:
    pictures, rig = wall_views()
    lines: list[str] = []
    found = triangulate(pictures, rig, report=lines.append)
    assert "pycolmap" not in sys.modules
    assert len(found.points) > 100, lines
    # 0.3 px of matching error over a 20 to 60 px shift is 0.5 to 1.5 % of the depth
    assert np.median(np.abs(found.points[:, 2] - 4.0)) < 0.06
    assert found.colors.min() >= 0
    assert found.colors.max() <= 1
    assert (found.errors < 2.0).all()


@pytest.mark.slow
def test_a_flat_picture_gives_no_points_and_says_so() -> None:
    pictures, rig = wall_views()
    lines: list[str] = []
    found = triangulate(np.full_like(pictures, 128), rig, report=lines.append)
    assert found.points.shape == (0, 3)
    assert len(lines) == 1
    assert lines[0].startswith("Sparse points:")


def test_a_child_that_stands_still_is_ended_and_tried_again(monkeypatch, scratch) -> None:
    pictures, rig = wall_views()
    lines: list[str] = []
    started = []
    monkeypatch.setattr(process.subprocess, "Popen", _sleeping_child(started))
    found = triangulate(pictures, rig, report=lines.append, stall_s=0.5)
    assert len(found.points) == 0
    assert len(started) == child_process.N_ATTEMPTS
    assert all(child.returncode == -9 for child in started)
    assert "did not respond for" in lines[0]
    assert not list(scratch.iterdir())


@pytest.mark.slow
def test_a_slow_child_is_waited_for(scratch) -> None:
    pictures, rig = wall_views()
    n_looks = []
    lines: list[str] = []
    fast = triangulate(pictures, rig, report=lines.append)
    slow = triangulate(pictures, rig, report=lines.append, alive=lambda: n_looks.append(1) or time.sleep(0.3))
    assert n_looks
    assert len(fast.points)
    np.testing.assert_array_equal(fast.points, slow.points)
    assert not list(scratch.iterdir())


def test_whoever_is_interrupted_leaves_no_child_and_no_folder(monkeypatch, scratch) -> None:
    pictures, rig = wall_views()
    started = []
    monkeypatch.setattr(process.subprocess, "Popen", _sleeping_child(started))

    def stop() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        triangulate(pictures, rig, report=lambda _: None, alive=stop)
    assert [child.returncode for child in started] == [-9]
    assert not list(scratch.iterdir())


def test_folders_of_killed_processes_are_removed_and_those_of_living_ones_stay(scratch) -> None:
    done = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, check=True)
    dead, living = (scratch / f"clipgstream-sparse-{pid}-x" for pid in (int(done.stdout), os.getpid()))
    for folder in (dead, living):
        folder.mkdir()
        (folder / "job.npz").touch()
    folders.remove_leftovers(child_process.FOLDER_PREFIX)
    assert [folder.name for folder in scratch.iterdir()] == [living.name]


@pytest.fixture
def scratch(tmp_path, monkeypatch) -> Path:
    """The temporary folder of this test."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def _sleeping_child(started: list[subprocess.Popen]):
    """In place of a process that works, one that does nothing."""
    real = subprocess.Popen

    def start(_command, **options):
        started.append(real([sys.executable, "-c", "import time; time.sleep(60)"], **options))
        return started[-1]

    return start
