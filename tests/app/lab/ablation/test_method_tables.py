"""The commands of docs/method.md for the paper's tables run, cut down, on generated captures in the layouts of its data
sets and with as many cameras.
"""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from app.lab.ablation.running import RESULT_FILE, project_folder
from app.project.opening.project_access import read_settings
from app.training.messages import TrainJob
from app.training.store import ClipStore
from app.training.worker.build import build_training
from app.training.worker.interface import MakeTraining
from engine.progress import ReportProgress
from engine.training.presets import closest_preset
from tests.app.fakes import N_STEPS, FakeTraining, make_fake
from tests.documents.blocks import ROOT
from tests.engine.capture.layouts import written_colmap_frames, written_n3dv
from tests.engine.capture.layouts.scene import Scene, make_scene

ROW = re.compile(r"^\| (\d), .*`clipgstream ([^`]+)` \|$", re.MULTILINE)
COMMANDS = dict(ROW.findall((ROOT / "docs/method.md").read_text("utf-8")))
"""Number of a table to its command."""
N_CAMERAS = {"LONG360": 36, "GZ": 34, "N3DV": 21, "SALMON": 21}
CUT = ["--scale", 1, "--clip-length", 2, "--n-clips", 2, "--seeds", 0, "--no-fps", "--quiet"]
SMALL = ["joint_steps=2", "source_steps=2", "field_log2_entries=10", "head_hidden=16", "max_static_points=200"]


class Floor(Scene):
    """A patterned floor under the same cameras, which stereo finds; stripes move over it."""

    def picture(self, camera_index: int, frame_index: int) -> np.ndarray:
        """See Scene."""
        width, height = self.size
        x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        pose = np.linalg.inv(self.world_to_camera[camera_index])
        rays = np.stack([x, y, np.ones_like(x)], -1) @ np.linalg.inv(self.Ks[camera_index]).T @ pose[:3, :3].T
        places = pose[:3, 3] + rays * (pose[2, 3] / np.maximum(-rays[..., 2:], 0.1))
        pattern = np.sin(places[..., :2] @ [[5.0, 3.0, -8.0], [-4.0, 6.0, 7.0]] + [0.0, 0.3 * frame_index, 0.0])
        return np.round(128 + 100 * pattern).astype(np.uint8)


@pytest.fixture(autouse=True)
def without_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps that take no time are not waited for."""
    monkeypatch.setattr("app.evaluation.headless.POLL_EVERY_S", 0.0)


@pytest.fixture(scope="module")
def captures(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Writes a capture by its name on the page, four small frames of every camera."""
    folder = tmp_path_factory.mktemp("captures")

    def write(name: str) -> Path:
        if not (folder / name).exists():
            names = [f"cam{row:02}" for row in range(N_CAMERAS[name])]
            made = make_scene(lens="pinhole", names=names, size=(24, 18), is_centered=True, is_one_focal=True)
            scene = Floor(made.names, made.Ks, made.lenses, made.world_to_camera, made.size, made.n_frames)
            if name in ("N3DV", "SALMON"):
                written_n3dv.write(folder / name, scene)
            else:
                written_colmap_frames.write(folder / name, scene, lens="pinhole")
        return folder / name

    return write


def make_short(job: TrainJob, store: ClipStore, report: ReportProgress) -> FakeTraining:
    """A fake that takes as few steps whatever the settings are."""
    training = make_fake(job, store, report)
    training.n_steps, training.fails_at = N_STEPS, None
    return training


def check(run, captures, folder: Path, table: str, *more: object, make_training: MakeTraining) -> None:
    """Run the command of a table and look at what it leaves."""
    command, name, *arguments = shlex.split(COMMANDS[table])
    given = dict(zip(arguments[::2], arguments[1::2], strict=True))
    code, _, err = run(
        command, captures(name), *arguments, "--project", folder, *CUT, *more, make_training=make_training
    )
    assert code == 0, err
    document = json.loads((folder / RESULT_FILE).read_text())
    assert {line["variant"] for line in document["lines"]} == set(given["--variants"].split(","))
    assert all(line["psnr"] is not None for line in document["lines"])
    assert document["holdout"] == [f"cam{int(row):02}" for row in given["--holdout"].split(",")]


@pytest.mark.slow
@pytest.mark.parametrize("table", COMMANDS)
def test_the_command_of_a_table_runs(run, captures, tmp_path: Path, table: str):
    check(run, captures, tmp_path / "a", table, make_training=make_short)
    preset = shlex.split(COMMANDS[table])[5]
    assert closest_preset(read_settings(project_folder(tmp_path / "a", "full", 0)).overrides) == preset


@pytest.mark.slow
def test_the_ablations_of_the_paper_are_trained(run, captures, tmp_path: Path):
    settings = [part for setting in SMALL for part in ("--set", setting)]
    check(run, captures, tmp_path / "a", "5", *settings, make_training=build_training)


def test_there_is_a_command_for_every_table():
    assert list(COMMANDS) == ["1", "2", "3", "4", "5", "6"]
