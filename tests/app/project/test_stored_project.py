"""A project that an earlier version wrote: it opens, its clips are what they were, and training goes on from them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
import torch

from app.project.clips.clip_catalog import ClipCatalog
from app.project.opening.project_access import open_project
from app.project.project import Project
from app.training.curves import read_curves
from app.training.jobs import train_job
from app.training.worker.build import build_training
from app.training.worker.folder_store import FolderStore
from engine.assets import asset_path
from engine.backends.table import backend_called
from engine.capture.capture import open_capture
from engine.clip_files.clip_state import read_clip_state
from engine.model.reading import load_clip_model

STORED = Path(__file__).parents[2] / "data" / "stored_project"
"""Clips 0 and 1 of the sample at a quarter of its size, as small as they can be trained."""


@pytest.fixture
def project(tmp_path: Path) -> Project:
    folder = tmp_path / "p"
    shutil.copytree(STORED, folder)
    content = json.loads((folder / "project.json").read_text())
    (folder / "project.json").write_text(json.dumps(content | {"capture": str(asset_path("sample"))}))
    return open_project(folder, is_writable=False)


def test_its_clips_are_trained_and_their_arrays_are_what_they_were(project: Project) -> None:
    catalog = ClipCatalog(project, 3)
    assert [catalog[index].state for index in range(3)] == ["trained", "trained", "untrained"]
    assert [catalog[index].n_anchors for index in range(2)] == [(0, 1096), (1096, 29)]
    assert catalog[1].held_out_psnr == pytest.approx(17.19, abs=0.01)
    states = [read_clip_state(project.clip_path(index)) for index in range(2)]
    for state in states:  # the version that wrote the file computed this over what it decoded
        assert state.fingerprint == state.header.fingerprint
    for state in states:
        gaussians = load_clip_model(state, states[0], backend=backend_called("cpu")).decode(0.0)
        assert torch.isfinite(gaussians.means).all()
        assert len(gaussians.means) > 0


def test_its_curves_are_read(project: Project) -> None:
    assert [step for step, _ in read_curves(project.metrics_path(1)).psnr] == [0, 54]


@pytest.mark.slow
def test_its_next_clip_is_trained(project: Project) -> None:
    settings = project.settings
    capture = open_capture(asset_path("sample"), scale=settings.scale)
    clip, holdout = project.clips(capture.n_frames)[2], capture.camera_indices(settings.holdout)
    job = train_job(project, clip, holdout=holdout)
    training = build_training(job, FolderStore(project.folder), lambda progress: None)
    training.prepare()
    stats = training.step()
    assert (stats.step, training.state().header.start) == (1, 6)
    assert training.state().header.reference_fingerprint == read_clip_state(project.clip_path(0)).header.fingerprint
