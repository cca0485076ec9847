"""Cameras for other programs: read back by the readers of those layouts, they are the same."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.evaluation.headless import TrainedProject
from app.export.cameras_job import WORLD, CamerasJob, estimate, run
from app.export.export_progress import ExportProgress
from app.export.gaussians.file_place import file_world
from app.export.jobs.sequence import SequenceJob
from app.export.usd_cameras import write_usd_cameras
from engine.camera.camera_path import CameraKey, CameraPath
from engine.camera.corrections import N_VALUES, corrected
from engine.capture.colmap.model_cameras import read_rig
from engine.children.kind import Unwanted
from engine.clip_files.array_names import CORRECTIONS
from engine.clip_files.clip_state import ClipState
from engine.errors import ProjectError
from engine.export.sequences.table import SEQUENCES
from engine.export.world import AXES, world


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


def test_usd_has_cameras_and_paths_that_see_what_they_see_here(opened: TrainedProject, tmp_path: Path):
    """A point falls where K and pose put it, through the window that USD's own camera computes; times are frames."""
    Usd, UsdGeom, Gf = (pytest.importorskip(f"pxr.{name}") for name in ("Usd", "UsdGeom", "Gf"))
    layout = opened.capture.layout
    placed = world(np.array([0.1, -0.9, 0.2]), up="+z", scale=2.5)
    moved_K = np.array([[0, 0, 1.5], [0, 0.7, -2.0], [0, 0, 0]])
    cameras = tuple(replace(entry, K=entry.K + moved_K) for entry in layout.cameras)
    moved = np.eye(4)
    moved[:3, 3] = [0.1, -0.2, 0.3]
    start = layout.cameras[0].world_to_camera
    keys = (CameraKey(0.0, start, 0.6), CameraKey(4.0, moved @ start, 0.9))
    lines = write_usd_cameras(
        tmp_path,
        cameras,
        [CameraPath("Way in", keys), CameraPath("way in")],
        n_frames=6,
        fps=25.0,
        world=placed,
        meters_per_unit=0.5,
    )
    assert lines == ("The camera path 'way in' has no keys and is left out.",)
    stage = Usd.Stage.Open(str(tmp_path / "cameras.usda"))
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 0.5
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode(), stage.GetFramesPerSecond()) == (0, 5, 25)
    prims = stage.GetDefaultPrim().GetChildren()
    assert len(prims) == len(cameras) + 1

    def seen(prim, frame: float, point: np.ndarray) -> np.ndarray:
        """From -1 to 1 across the picture, x to the right and y up."""
        frustum = UsdGeom.Camera(prim).GetCamera(frame).frustum
        matrix = frustum.ComputeViewMatrix() * frustum.ComputeProjectionMatrix()
        return np.array(matrix.Transform(Gf.Vec3d(*(placed.scale * placed.rotation @ point))))[:2]

    points = opened.capture.rig.centers.mean(0) + np.random.default_rng(0).normal(0, 0.2, (8, 3))
    for prim, entry in zip(prims, cameras, strict=False):
        (width, height), pose = entry.image_size, entry.world_to_camera
        for point in points:
            x, y, z = entry.K @ (pose[:3, :3] @ point + pose[:3, 3])
            expected = [2 * x / z / width - 1, 1 - 2 * y / z / height]
            np.testing.assert_allclose(seen(prim, 0, point), expected, atol=1e-5)
    way = CameraPath("Way in", keys)
    for frame in (0.0, 3.0, 4.0):
        pose, fov_rad = way.at(frame)
        x, y, z = pose[:3, :3] @ points[0] + pose[:3, 3]
        expected = np.array([x / z * 9 / 16, -y / z]) / np.tan(fov_rad / 2)
        np.testing.assert_allclose(seen(prims[-1], frame, points[0]), expected, atol=1e-5)


def test_usd_cameras_stand_where_usd_files_have_the_scene(opened, tmp_path: Path):
    Usd, UsdGeom, Gf = (pytest.importorskip(f"pxr.{name}") for name in ("Usd", "UsdGeom", "Gf"))
    entry, point = opened.capture.layout.cameras[0], opened.capture.rig.centers.mean(0)
    x, y, z = entry.K @ (entry.world_to_camera[:3, :3] @ point + entry.world_to_camera[:3, 3])
    width, height = entry.image_size
    for name, chosen in (("usual", {}), ("chosen", {"up": "+z", "scale": 100.0, "scene_up": (0.2, 0.0, 1.0)})):
        result = run(opened, CamerasJob(tmp_path / name, "usd", **chosen), nothing)
        placed = file_world(opened, SequenceJob(tmp_path / "s.usda", "usda", **chosen), usual_up=SEQUENCES["usda"].up)
        assert any(placed.text in line for line in result.lines)
        stage = Usd.Stage.Open(str(tmp_path / name / "cameras.usda"))
        assert AXES["+" + UsdGeom.GetStageUpAxis(stage).lower()] == pytest.approx(placed.up)
        frustum = UsdGeom.Camera(stage.GetDefaultPrim().GetChildren()[0]).GetCamera(0).frustum
        matrix = frustum.ComputeViewMatrix() * frustum.ComputeProjectionMatrix()
        seen = np.array(matrix.Transform(Gf.Vec3d(*(placed.scale * placed.rotation @ point))))[:2]
        np.testing.assert_allclose(seen, [2 * x / z / width - 1, 1 - 2 * y / z / height], atol=1e-5)


def test_other_formats_keep_the_coordinates_of_the_capture(tmp_path: Path):
    for format_ in ("colmap", "transforms"):
        with pytest.raises(ProjectError, match=f"--up does not apply to cameras-{format_}"):
            CamerasJob(tmp_path / "c", format_, up="+y").check()
    CamerasJob(tmp_path / "c", "usd", up="+y").check()


def test_usd_is_exported_and_a_missing_library_is_said_with_the_remedy(opened, tmp_path: Path, monkeypatch):
    pytest.importorskip("pxr")
    result = run(opened, CamerasJob(tmp_path / "u", "usd"), nothing)
    assert (tmp_path / "u" / "cameras.usda").is_file()
    assert result.n_files == 1
    monkeypatch.setitem(sys.modules, "pxr.Usd", None)
    with pytest.raises(ProjectError, match="not installed") as error:
        run(opened, CamerasJob(tmp_path / "v", "usd"), nothing)
    assert "clipgstream[usd]" in error.value.hint
    assert not (tmp_path / "v").exists()
