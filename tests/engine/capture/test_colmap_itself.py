"""What COLMAP itself writes is read, and what is written here is read by COLMAP, which runs in a child process."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from engine.camera.lens import Lens
from engine.capture.capture import open_capture
from engine.capture.colmap.camera_models import UNREAD
from engine.capture.colmap.model_cameras import read_rig
from engine.capture.points import read_points
from engine.capture.writers.colmap import write_colmap
from engine.capture.writers.conversion import convert
from tests.engine.capture.layouts import written_colmap
from tests.engine.capture.layouts.scene import make_points, make_scene, projected

AGREE_PX = 1e-6


def run_child(what: str, folder: Path) -> None:
    subprocess.run(
        [sys.executable, "-m", "tests.engine.capture.pycolmap_child", what, str(folder)], check=True, timeout=600
    )


@pytest.fixture(scope="module")
def by_colmap(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("colmap") / "model"
    run_child("write", folder)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["binary", "text"])
def test_every_model_of_colmap_projects_as_in_colmap(by_colmap: Path, kind: str) -> None:
    rig = read_rig(by_colmap / kind)
    expected = json.loads((by_colmap / "expected.json").read_text())
    assert {camera.name for camera in rig.cameras} == set(expected["pixels"]) - set(UNREAD.values())
    for camera in rig.cameras:
        found = projected(camera.K, camera.lens, camera.world_to_camera, np.array(expected["points"]))
        assert np.abs(found - expected["pixels"][camera.name]).max() < AGREE_PX, camera.name
    said = " ".join(problem.message for problem in rig.problems)
    for name in ("RAD_TAN_THIN_PRISM_FISHEYE", "SIMPLE_DIVISION", "DIVISION"):
        assert f"{name} is not supported" in said


@pytest.mark.parametrize("name", ["binary/points3D.bin", "text/points3D.txt", "points.ply"])
def test_points_of_colmap(by_colmap: Path, name: str) -> None:
    cloud = read_points(by_colmap / name)
    expected = np.array(json.loads((by_colmap / "expected.json").read_text())["points"])
    assert cloud.colors is not None
    order = np.argsort(cloud.colors[:, 0])
    assert np.allclose(cloud.points[order], expected, atol=1e-6)
    assert np.array_equal(cloud.colors[order, 1], 2 * np.arange(10))


LENSES = (
    Lens(),
    Lens("opencv", (-0.1, 0.02, 0.003, -0.002)),
    Lens("opencv", (-0.1, 0.02, 0.003, -0.002, 0.01, 0.02, -0.01, 0.003)),
    Lens("fisheye", (0.06, -0.02)),
    Lens("fov", (0.8,)),
    Lens("thin_prism_fisheye", (0.05, -0.02, 0.003, -0.002, 0.004, 0.001, 0.002, -0.001)),
)


@pytest.mark.slow
def test_colmap_reads_what_is_written(tmp_path: Path) -> None:
    scene = make_scene(lens="pinhole", names=[f"cam{row}" for row in range(len(LENSES))])
    object.__setattr__(scene, "lenses", LENSES)
    written_colmap.write(tmp_path / "capture", make_scene(lens="pinhole", names=scene.names), lens="pinhole")
    layout = open_capture(tmp_path / "capture").layout
    for entry, lens in zip(layout.cameras, LENSES, strict=True):
        object.__setattr__(entry, "lens", lens)
    cloud = read_points_of(tmp_path)
    for kind in ("binary", "text"):
        write_colmap(layout, tmp_path / f"as {kind}", cloud, is_binary=kind == "binary")
        (tmp_path / f"as {kind}" / "sparse/0").rename(tmp_path / kind)
    (tmp_path / "points.json").write_text(json.dumps(make_points().tolist()))
    run_child("read", tmp_path)
    for found in json.loads((tmp_path / "read.json").read_text()).values():
        assert found["n_points"] == len(cloud.points)
        assert found["sizes"] == [[48, 32]] * len(LENSES)
        for row, name in enumerate(scene.names):
            error = np.abs(np.array(found["pixels"][f"{name}.png"]) - scene.project(row, make_points())).max()
            assert error < AGREE_PX, (name, LENSES[row])


def read_points_of(folder: Path):
    from engine.capture.points import CapturePoints
    from engine.capture.writers.point_files import write_ply

    write_ply(folder / "cloud.ply", CapturePoints(make_points(), None))
    return read_points(folder / "cloud.ply")


def test_a_converted_capture_has_the_model_for_colmap(tmp_path: Path) -> None:
    scene = make_scene(lens="opencv5")
    written_colmap.write(tmp_path / "capture", scene, lens="opencv5")
    convert(open_capture(tmp_path / "capture").layout, tmp_path / "new", "colmap", frames="copy", is_binary=True)
    assert (tmp_path / "new/sparse/0/images.bin").is_file()
    assert (tmp_path / "new/videos/cam10.mp4").is_file()
