"""Projects as ablations train them: any reference clip, and one field that goes on from clip to clip."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from app.document.project_settings import ProjectSettings
from app.evaluation.headless import open_trained
from app.project.opening.project_access import create_project, default_settings
from app.project.project import Project
from app.training.jobs import train_job
from app.training.messages import TrainJob
from app.training.worker.folder_store import FolderStore
from engine.capture.capture import open_capture
from engine.clip_files.clip_state import read_clip_state
from engine.errors import ProjectError
from tests.clip_headers import with_header


def test_clips_are_trained_from_the_reference_on(tmp_path):
    settings = ProjectSettings(capture="c", fingerprint="f", reference_clip=2, clip_length=2)
    project = create_project(tmp_path / "p", settings)
    assert project.training_order(4) == [2, 0, 1, 3]
    assert (project.inherited_index(0), project.inherited_index(2), project.base_index(1)) == (2, None, 2)
    project.update(replace(settings, overrides={"independent": True}))
    assert (project.inherited_index(0), project.base_index(1)) == (None, 1)
    project.update(replace(settings, overrides={"field": "joint"}))
    assert [clip.n_frames for clip in project.clips(7)] == [7]
    project.close()


def test_a_reference_clip_that_is_none_is_refused(capture_folder):
    capture = open_capture(capture_folder)
    assert default_settings(capture, clip_length=3, reference_clip=1).reference_clip == 1
    for reference_clip, overrides in ((2, {}), (-1, {}), (1, {"field": "joint"})):
        with pytest.raises(ProjectError, match=f"reference clip is {reference_clip}"):
            default_settings(capture, clip_length=3, reference_clip=reference_clip, overrides=overrides)


@pytest.fixture
def continued(tmp_path, built_once) -> Iterator[tuple[Project, list[TrainJob]]]:
    """A real project of the sample whose one field goes on: reference clip 1, then clip 0; and its jobs."""
    from engine.clip_files.clip_state import write_clip_state
    from tests.engine.training.tiny_training import SIZES, make_tiny

    tiny = make_tiny(tmp_path / "tiny", built_once)
    reference = with_header(tiny.reference, clip_index=1, start=4)
    settings = default_settings(
        tiny.capture,
        clip_length=4,
        holdout=tuple(tiny.capture.rig.names[camera] for camera in tiny.holdout),
        overrides=SIZES | {"field": "continue"},
        reference_clip=1,
    )
    project = create_project(tmp_path / "p", settings)
    project.prep_dir.mkdir()
    for path in tiny.prep_dir.iterdir():
        shutil.copy(path, project.prep_dir)
    first = tiny.trained(0, reference=reference, previous=reference, field="continue")
    for i, state in ((0, first), (1, reference)):
        write_clip_state(project.clip_path(i), state)
    yield project, [train_job(project, clip, holdout=tiny.holdout) for clip in project.clips(tiny.capture.n_frames)]
    project.close()


@pytest.mark.slow
def test_one_field_goes_on_in_training_order_and_shows_every_clip_as_it_ends(continued, monkeypatch):
    from app.training.worker import build
    from engine.training.clip_training import ClipTraining

    monkeypatch.setattr(build, "warm_up_reporting", lambda report: None)
    project, jobs = continued
    store = FolderStore(project.folder)
    opened = open_trained(project)
    fields = []
    for i in (0, 1):
        field = opened.load(i).model.field
        assert field is not None
        assert not any(parameter.requires_grad for parameter in field.parameters())
        fields.append(field.hidden.weight.numpy())
    last = read_clip_state(project.clip_path(0)).arrays["field.hidden.weight"]
    assert np.array_equal(fields[0], last)
    assert np.array_equal(fields[1], last)  # not clip 1's own, though its number is higher
    training = build.build_training(jobs[2], store, lambda _: None)
    assert isinstance(training, ClipTraining)
    assert training.previous is not None
    assert training.previous.header.clip_index == 0
    assert training.reference is not None
    assert training.reference.header.clip_index == 1
    with pytest.raises(ProjectError, match="Clip 0002 is not trained"):
        build.build_training(jobs[3], store, lambda _: None)
    alone = build.build_training(jobs[1], store, lambda _: None)
    assert isinstance(alone, ClipTraining)
    assert (alone.reference, alone.previous) == (None, None)
