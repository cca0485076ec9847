"""Trainings whose pictures are cut into windows, and kept in a file: as good as whole pictures, and resumable."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from engine.training import clip_training
from engine.training.preparation import training_pictures
from engine.training.preparation.picture_store import PictureStore
from engine.training.windows import Windows
from tests.engine.training.tiny_training import Tiny, finish, same_arrays, take_steps


@pytest.fixture
def small_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two windows of a picture of 80 x 60."""
    monkeypatch.setattr(clip_training, "Windows", partial(Windows, max_pixels=40 * 60))


def test_windows_are_as_good_as_whole_pictures(tiny: Tiny, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    steps = {"static_steps": 60, "joint_steps": 60, "is_source": False}
    whole = tiny.prepared(0, prep_dir=tmp_path, **steps)
    finish(whole)
    monkeypatch.setattr(clip_training, "Windows", partial(Windows, max_pixels=40 * 60))
    # limits of anchors grow with the number of windows
    cut = tiny.training(0, prep_dir=tmp_path, max_static_points=354, max_moving_points=212, **steps)
    assert len(cut.windows) == 2
    cut.prepare()
    first = cut.held_out_psnr()
    finish(cut)
    assert cut.held_out_psnr() > first + 0.4
    assert cut.held_out_psnr() > whole.held_out_psnr() - 1.5


@pytest.mark.usefixtures("small_windows")
def test_a_stopped_training_of_windows_goes_on_to_the_bit(tiny: Tiny, tmp_path: Path):
    settings = {"prep_dir": tmp_path, "is_source": False, "static_steps": 5, "joint_steps": 9}
    whole = finish(tiny.prepared(0, **settings))
    for n_done in (3, 8, 12):  # one in each phase
        stopped = take_steps(tiny.prepared(0, **settings), n_done)
        stopped.write_checkpoint(tmp_path / "checkpoint")
        resumed = tiny.training(0, **settings)
        resumed.restore_checkpoint(tmp_path / "checkpoint")
        assert same_arrays(finish(resumed).arrays, whole.arrays)


@pytest.mark.usefixtures("small_windows")
def test_a_source_clip_leaves_out_windows_in_which_nothing_can_move(tiny: Tiny):
    training = tiny.prepared(1, inherit="frozen")
    assert len(training._items) == len(training.windows) * len(training.pictures), "something moves everywhere here"
    for role in ("residual", "moving"):
        presence = training.model.anchor_set(role).presence
        assert presence is not None
        presence[:, 1:] = False
    items = training._items_of("source")
    assert items
    assert {training.place(item).clip_time for item in items} == {0.0}
    away = training.model.anchor_set("residual")
    inherited = training.model.anchor_set("moving")
    assert inherited.presence is not None
    inherited.presence[:] = False
    center = training._cameras.view(0).world_to_camera.inverse()[:3, 3]
    away.positions[:] = center - 5.0 * training._cameras.view(0).world_to_camera[2, :3]  # behind the first camera
    assert 0 not in {training.place(item).camera_row for item in training._items_of("source")}


def test_pictures_in_a_file_train_the_same_bits(tiny: Tiny, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    in_memory = tiny.trained(1)
    monkeypatch.setattr(training_pictures, "PictureStore", partial(PictureStore, max_bytes=3 * 4 * 80 * 60 * 3))
    on_disk = tiny.trained(1)
    assert same_arrays(in_memory.arrays, on_disk.arrays)


@pytest.mark.usefixtures("small_windows")
def test_limits_of_anchors_grow_with_the_side_of_a_picture(tiny: Tiny, tmp_path: Path):
    training = tiny.training(0, prep_dir=tmp_path, is_source=False)
    grown = training._preparation._config.max_static_points
    assert grown == round(500 * np.sqrt(2))
    assert training.config.max_static_points == 500, "what is stored is what was set"


@pytest.mark.usefixtures("small_windows")
def test_windows_that_a_lens_does_not_reach_are_not_drawn(tiny: Tiny):
    training = tiny.prepared(1)
    height, width = training.pictures.picture(0, 0).shape[:2]
    is_valid = np.ones((training.pictures.n_cameras, height, width), bool)
    window = training.windows[1]
    is_valid[2, :, window.x :] = False
    training.pictures.is_valid = is_valid
    left_out = {training.place(item)[:2] for item in range(2 * len(training.pictures))} - {
        training.place(item)[:2] for item in training._windows_of(range(len(training.pictures)))
    }
    assert left_out == {(2, 1)}
