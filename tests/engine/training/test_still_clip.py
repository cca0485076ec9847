"""A clip in which nothing moves: no field, no residual anchors, no steps, negligible to store."""

from __future__ import annotations

import numpy as np
import pytest
from safetensors.numpy import load_file

from engine.backends.table import backend_called
from engine.clip_files.clip_state import read_clip_state
from engine.clip_files.compact import write_compact_clip
from engine.model.reading import load_clip_model
from engine.training.plan.plan import footage_of, make_plan
from engine.training.preparation import clip_preparation
from engine.training.preparation.cloud_preparation import BACKGROUNDS_FILE
from engine.training.preparation.training_pictures import TrainingPictures

MAX_BYTES = 20_000


@pytest.fixture
def still(tiny, monkeypatch):
    """A source clip whose every picture is its camera's background, prepared."""
    images = load_file(tiny.prep_dir / BACKGROUNDS_FILE)["images"]

    class StillPictures(TrainingPictures):
        def picture(self, camera_row, frame_in_clip):
            return images[camera_row]

        def of_camera(self, camera_row):
            return np.stack([images[camera_row]] * self.clip.n_frames)

    monkeypatch.setattr(clip_preparation, "TrainingPictures", StillPictures)
    return tiny.prepared(1)


def test_it_takes_no_step(still):
    assert still.model.field is None
    assert "residual" not in still.model.roles()
    assert still.n_steps == still.steps_done == 0
    assert still.is_finished


def test_it_stores_a_few_kilobytes_and_can_be_seen(still, tiny, tmp_path):
    path = tmp_path / "still.safetensors"
    write_compact_clip(path, still.finish())
    assert path.stat().st_size < MAX_BYTES
    state = read_clip_state(path)
    assert state.header.n_alive == 0
    model = load_clip_model(state, tiny.reference, backend=backend_called("cpu"))
    static_alone = tiny.reference.header.n_anchors["static"] * model.decoder.gaussians_per_anchor
    assert len(model.decode(0.0)) == static_alone  # inherited moving anchors are there and switched off


def test_its_plan_says_so(still, tiny):
    footage = footage_of(tiny.capture, tiny.holdout)
    plan = make_plan(
        footage, tiny.clips[1], still.config, is_source=True, reference=tiny.reference.header, is_still=True
    )
    assert plan.n_steps == plan.training_s == 0
