"""Exported sequences in Blender itself, through our add-on: values, timing, cameras, relinking, bad input, a picture.

BLENDER_PYTHON names a Python with bpy; ./setup.sh --tests installs one where there is a bpy for this system.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from PIL import Image

from app.document.changes import world_changes
from app.evaluation.headless import TrainedProject, open_trained
from app.export.gaussians.gaussians_job import run
from app.export.jobs.gaussians import GaussiansJob
from app.export.picked_frames import PickedFrames
from app.export.scene_frames import SceneFrames
from app.project.opening.project_access import open_project
from engine.camera.projection import to_camera, to_pixels
from engine.export.blender_addon import write_addon
from engine.export.formats.table import FORMATS
from engine.export.splats import Splats
from engine.images.psnr import psnr
from engine.model.clip_view import render_gaussians
from tests.app.stored_project import copy_stored

FOLDER = Path(__file__).parent
PYTHON = Path(os.environ.get("BLENDER_PYTHON") or Path(sys.prefix) / "blender" / "bin" / "python")
TIMEOUT_S = 600
METERS_PER_UNIT, SCALE = 0.25, 2.0

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not PYTHON.exists(), reason="no Python with bpy; ./setup.sh --tests installs one, BLENDER_PYTHON names another"
    ),
]


def blender(work: str, folder: Path) -> dict[str, Any]:
    """What `blender_program` writes down of a folder."""
    said = folder / "said.json"
    done = subprocess.run(
        [str(PYTHON), str(FOLDER / "blender_program.py"), work, str(folder), str(write_addon(folder))],
        env={**os.environ, "BLENDER_USER_RESOURCES": str(folder / "user"), "PYTHONPATH": ""},
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        check=False,
    )
    assert said.is_file(), done.stdout + done.stderr
    assert "Traceback" not in done.stdout + done.stderr, done.stdout + done.stderr
    return json.loads(said.read_text())


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory) -> TrainedProject:
    """A trained project whose unit is 25 cm."""
    folder = copy_stored(tmp_path_factory.mktemp("project") / "p")
    writable = open_project(folder)
    writable.change(world_changes.set_scale(writable.document, METERS_PER_UNIT), "set the scale")
    writable.close()
    return open_trained(open_project(folder, is_writable=False))


def export(opened: TrainedProject, out: Path, **options: Any) -> None:
    job = GaussiansJob(out, "ply", **({"frames": PickedFrames.of(range(1, 6)), "up": "-y", "scale": SCALE} | options))
    run(opened, job, lambda progress: None)


@pytest.fixture(scope="module")
def folder(opened: TrainedProject, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Exports, and folders with something wrong in each."""
    folder = tmp_path_factory.mktemp("blender")
    export(opened, folder / "split", part="split")
    export(opened, folder / "again", frames=PickedFrames.of(range(2, 4)))
    shutil.copytree(folder / "split", folder / "kept")
    for name in ("truncated", "newer", "missing", "without_file"):
        shutil.copytree(folder / "again", folder / "bad" / name)
    truncated = folder / "bad" / "truncated" / "p_0002.ply"
    truncated.write_bytes(truncated.read_bytes()[:-7])
    newer = folder / "bad" / "newer" / "p_export.json"
    newer.write_text(json.dumps(json.loads(newer.read_text()) | {"schema": 7}))
    (folder / "bad" / "missing" / "p_export.json").unlink()
    (folder / "bad" / "without_file" / "p_0002.ply").unlink()
    return folder


@pytest.fixture(scope="module")
def said(folder: Path) -> dict[str, Any]:
    return blender("check", folder)


def written(path: Path) -> Splats:
    with path.open("rb") as file:
        return FORMATS["ply"].read(file)


def upright(splats: Splats) -> np.ndarray:
    """Centres as they have to be in Blender: -y of the files is z there, and metres."""
    metres = METERS_PER_UNIT / SCALE * splats.means.astype(float)
    return metres[:, [0, 2, 1]] * [1.0, 1.0, -1.0]


def test_gaussians_are_those_of_the_files_upright_and_in_metres(said: dict, folder: Path):
    assert said["problem"] == ""
    for frame in (1, 4):
        for part, name in (("static", "p_static.ply"), ("moving", f"p_moving_{frame:04d}.ply")):
            path = folder / "kept" / name
            truth, found = written(path), np.load(folder / f"{part}_{frame}.npz")
            assert len(truth) > 10
            np.testing.assert_allclose(found["position"], upright(truth), atol=1e-5)
            np.testing.assert_allclose(found["scale"], truth.scales, rtol=1e-4, atol=1e-4 * truth.scales.max())
            np.testing.assert_allclose(found["rotation"], truth.quats, atol=1e-5)
            np.testing.assert_allclose(found["opacity"][:, 0], truth.opacities, atol=1e-5)
            encoded = np.clip(truth.colors, 0.0, 1.0)
            linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
            np.testing.assert_allclose(found["color"][:, :3], linear, atol=1e-4)


def test_the_scene_has_timing_and_cameras_of_the_sequence(said: dict, opened: TrainedProject):
    assert (said["range"], said["fps"]) == ([1, 5], pytest.approx(opened.capture.fps, rel=1e-6))
    assert said["collection"] == "p"
    assert said["cameras"] == list(opened.rig.names)
    assert said["camera"] == opened.rig.names[0]
    assert said["sizes"] == dict(zip(opened.rig.names, opened.rig.image_sizes.tolist(), strict=True))


def test_points_are_at_our_pixels_in_every_camera(said: dict, opened: TrainedProject, folder: Path):
    """Means of still Gaussians, which Blender places in metres, through the capture's cameras in scene units."""
    static = Splats.of(SceneFrames(opened).gaussians(1, "static")).means[::20].astype(float)
    rig, n_inside = opened.rig, 0
    for camera, name in enumerate(rig.names):
        seen = to_camera(static, rig.world_to_camera[camera])
        ours = to_pixels(seen, rig.Ks[camera])
        is_inside = (seen[:, 2] > 0.1) & (ours >= 0).all(1) & (ours < rig.image_sizes[camera]).all(1)
        n_inside += int(is_inside.sum())
        theirs = np.array(said["pixels"][name])
        assert np.abs(theirs - ours)[is_inside].max(initial=0.0) < 0.1, name
    assert n_inside > 100


def test_time_follows_the_frame_rate_and_the_settings(said: dict, folder: Path):
    def moving(frame: int) -> int:
        return len(written(folder / "kept" / f"p_moving_{frame:04d}.ply"))

    numbers = [moving(frame) for frame in range(1, 6)]
    assert len(set(numbers)) == 5, "frames can be distinguished by their number of Gaussians"
    still = len(written(folder / "kept" / "p_static.ply"))
    assert said["counts"]["half the frame rate"] == {"static": still, "moving": moving(3)}
    assert said["counts"]["half the speed"] == {"static": still, "moving": moving(3)}
    assert said["counts"]["outside"] == {"static": None, "moving": None}
    assert said["counts"]["moving"] == {"static": None, "moving": moving(5)}
    assert said["counts"]["limit"] == {"static": None, "moving": 7}
    assert said["counts"]["loaded"] == {"static": still, "moving": moving(1)}
    assert said["counts"]["after loading"] == {"static": still, "moving": moving(5)}


def test_what_moved_and_what_was_exported_again_is_linked_again(said: dict, opened: TrainedProject, folder: Path):
    assert "Relink it if it was moved" in said["moved"] or "Relink the sequence" in said["moved"]
    assert said["counts"]["moved"] == said["counts"]["after loading"], "the last picture stays"
    assert said["relinked"] == ""
    truth = written(folder / "elsewhere" / "p_0002.ply")
    assert said["counts"]["again"] == {"all": len(truth)}
    np.testing.assert_allclose(np.load(folder / "again.npz")["position"], upright(truth), atol=1e-5)
    assert said["camera again"] == opened.rig.names[-1], "the one that was looked through last"


def test_nodes_of_the_user_in_place_of_ours_are_left_alone(said: dict, folder: Path):
    assert said["without our nodes"] == ["", len(written(folder / "elsewhere" / "p_0003.ply"))]


def test_bad_input_is_an_error_in_words_and_leaves_nothing(said: dict):
    assert "ends too early" in said["refused"]["truncated"]
    assert "schema 7" in said["refused"]["newer"]
    assert "No such file" in said["refused"]["missing"]
    assert "No such file" in said["refused"]["without_file"]
    assert "cannot be read" in said["not relinked"]
    assert said["stays"]
    assert said["left over"] == 0


def test_cycles_draws_what_we_draw(opened: TrainedProject, tmp_path: Path):
    export(opened, tmp_path / "all", frames=PickedFrames.of(range(4, 5)), up="+z", scale=None)
    assert blender("render", tmp_path)["camera"] == opened.rig.names[0]
    scene = SceneFrames(opened)
    trained = scene.trained(4)
    with torch.no_grad():
        view = trained.view(opened.rig, 0)
        ours = render_gaussians(scene.gaussians(4), view, backend=trained.model.backend).image[0].numpy()
    found = {
        colors: psnr(np.asarray(Image.open(tmp_path / f"{colors}.png").convert("RGB")) / 255.0, np.clip(ours, 0.0, 1.0))
        for colors in ("LINEAR", "DISPLAY")
    }
    assert found["DISPLAY"] > 30.0, found  # Cycles averages over more than a pixel
    assert found["LINEAR"] > 25.0, found  # light is added, not its encoding
