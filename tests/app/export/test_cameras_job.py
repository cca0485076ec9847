"""Cameras for other programs: read back by the readers of those layouts, they are the same."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.evaluation.headless import TrainedProject
from app.export.cameras_job import WORLD, CamerasJob, estimate, run
from app.export.export_progress import ExportProgress
from engine.camera.corrections import N_VALUES, corrected
from engine.capture.colmap.model_cameras import read_rig
from engine.children.kind import Unwanted
from engine.clip_files.array_names import CORRECTIONS
from engine.clip_files.clip_state import ClipState
from engine.errors import ProjectError


def nothing(progress: ExportProgress) -> None:
    """For who does not look."""


def test_colmap_has_the_same_cameras(opened: TrainedProject, tmp_path: Path):
    result = run(opened, CamerasJob(tmp_path / "c"), nothing)
    found = read_rig(tmp_path / "c" / "sparse" / "0").cameras
    assert len(found) == 4
    for entry, camera in zip(opened.capture.layout.cameras, found, strict=True):
        np.testing.assert_allclose(camera.world_to_camera, entry.world_to_camera, atol=1e-12)
        np.testing.assert_allclose(camera.K, entry.K, atol=1e-12)
    assert WORLD in result.lines
    assert result.n_files == 3


def test_transforms_has_a_row_per_picture(opened: TrainedProject, tmp_path: Path):
    run(opened, CamerasJob(tmp_path / "t", "transforms"), nothing)
    found = json.loads((tmp_path / "t" / "transforms.json").read_text())
    assert len(found["frames"]) == 4 * 6
    flip = np.diag([1.0, -1.0, -1.0, 1.0])
    camera_to_world = np.array(found["frames"][0]["transform_matrix"]) @ flip
    expected = np.linalg.inv(opened.capture.layout.cameras[0].world_to_camera)
    np.testing.assert_allclose(camera_to_world, expected, atol=1e-12)
    pictures = [(tmp_path / "t" / row["file_path"]).resolve() for row in found["frames"]]
    assert all(path.is_file() for path in pictures)


def test_cameras_that_training_has_moved_are_where_it_saw_them(opened: TrainedProject, tmp_path: Path):
    assert opened.reference is not None
    corrections = np.zeros((3, N_VALUES), np.float32)
    corrections[1] = [0.01, -0.02, 0.03, 0.1, 0.2, -0.1, 0.05]  # of camera 2; 0 is held out
    arrays = {**opened.reference.arrays, CORRECTIONS: corrections}
    refined = replace(opened, reference=ClipState(arrays, opened.reference.header))
    result = run(refined, CamerasJob(tmp_path / "c"), nothing)
    assert "1 camera was refined in training and exported as refined; all others are as in the capture." in result.lines
    found = read_rig(tmp_path / "c" / "sparse" / "0").cameras
    expected = corrected(opened.capture.layout.rig(), ("1", "2", "3"), corrections)
    for row, camera in enumerate(found):
        np.testing.assert_allclose(camera.world_to_camera, expected.world_to_camera[row], atol=1e-9)
        np.testing.assert_allclose(camera.K, expected.Ks[row], atol=1e-9)
    moved = opened.capture.layout.cameras[2].world_to_camera
    assert np.abs(found[2].world_to_camera - moved).max() > 0.05


@pytest.mark.parametrize("format_", ["colmap", "transforms"])
def test_the_estimate_tells_the_files(opened: TrainedProject, tmp_path: Path, format_):
    job = CamerasJob(tmp_path / "c", format_)
    guess, result = estimate(opened, job), run(opened, job, nothing)
    assert guess.n_files == result.n_files
    assert 0.3 < guess.n_bytes / result.n_bytes < 3


def test_a_folder_that_is_taken_and_a_cancelled_export(opened: TrainedProject, tmp_path: Path):
    taken = tmp_path / "taken"
    taken.mkdir()
    (taken / "a").write_text("a")
    with pytest.raises(ProjectError, match="already taken"):
        run(opened, CamerasJob(taken), nothing)

    def cancel(progress: ExportProgress) -> None:
        raise Unwanted

    (tmp_path / "out").mkdir()
    with pytest.raises(Unwanted):
        run(opened, CamerasJob(tmp_path / "out" / "new"), cancel)
    assert list((tmp_path / "out").iterdir()) == []
