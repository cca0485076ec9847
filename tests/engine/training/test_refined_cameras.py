"""Trainings in which cameras learn: what is stored, who inherits it, and that all of it can be had again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from engine.clip_files.array_names import CORRECTIONS
from engine.clip_files.clip_state import ClipState
from engine.errors import ProjectError
from engine.metrics.clips.trained_clip import TrainedClip
from engine.training.clip_training import ClipTraining
from tests.engine.training.tiny_training import Tiny, finish, same_arrays, take_steps

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def own_tiny(tiny: Tiny, tmp_path_factory: pytest.TempPathFactory) -> Tiny:
    """With a reference clip whose cameras learned."""
    folder = tmp_path_factory.mktemp("refined")
    own = replace(tiny, prep_dir=folder)
    training = own.prepared(0, is_source=False, refine_cameras="on", camera_lr=0.05)
    reference = finish(training)
    training.finish()
    return replace(own, reference=reference)


def refining(own_tiny: Tiny) -> ClipTraining:
    return own_tiny.prepared(0, is_source=False, refine_cameras="on", camera_lr=0.05)


def test_corrections_are_stored_small_and_in_the_gauge(own_tiny: Tiny) -> None:
    found = own_tiny.reference.corrections
    assert found is not None
    assert found.shape == (len(own_tiny.reference.header.camera_names), 7)
    assert 1e-5 < np.abs(found[:, :3]).max() < 0.1
    assert abs(found[:, 6].mean()) < 0.02 * np.abs(found[:, 6]).max()  # each counts by its focal length


def test_without_the_setting_nothing_is_stored(tiny: Tiny) -> None:
    assert CORRECTIONS not in tiny.reference.arrays
    assert tiny.reference.corrections is None


def test_the_same_seed_gives_the_same_cameras(own_tiny: Tiny) -> None:
    assert same_arrays(finish(refining(own_tiny)).arrays, own_tiny.reference.arrays)


@pytest.mark.parametrize("n_steps", [5, 17])  # of 12 static and 12 joint ones
def test_cameras_go_on_from_a_checkpoint_bit_for_bit(own_tiny: Tiny, tmp_path: Path, n_steps: int) -> None:
    stopped = take_steps(refining(own_tiny), n_steps)
    stopped.write_checkpoint(tmp_path / "kept.safetensors")
    resumed = own_tiny.training(0, is_source=False, refine_cameras="on", camera_lr=0.05)
    resumed.restore_checkpoint(tmp_path / "kept.safetensors")
    for _ in range(2):
        assert torch.equal(resumed._cameras.pixels, stopped._cameras.pixels)
        assert same_arrays(resumed._phase.arrays(), stopped._phase.arrays())
        assert same_arrays(resumed.state().arrays, stopped.state().arrays)
        take_steps(stopped, 1)
        take_steps(resumed, 1)


def test_a_checkpoint_without_corrections_is_refused_where_cameras_learn(tiny: Tiny, tmp_path: Path) -> None:
    stopped = take_steps(tiny.prepared(0, is_source=False), 2)
    stopped.write_checkpoint(tmp_path / "kept.safetensors")
    with pytest.raises(ProjectError):
        tiny.training(0, is_source=False, refine_cameras="on").restore_checkpoint(tmp_path / "kept.safetensors")


def test_cameras_stay_while_only_moving_parts_learn(own_tiny: Tiny) -> None:
    training = refining(own_tiny)
    while training._stage != "moving":
        training.step()
    before = training._cameras.corrections
    assert before is not None
    finish(training)
    assert training.steps_done > training.phases[0][1] + training.phases[1][1] + 1
    after = training._cameras.corrections
    assert after is not None
    assert np.array_equal(after, before)


def test_later_clips_are_trained_with_the_corrected_cameras_and_leave_them(own_tiny: Tiny) -> None:
    source = own_tiny.prepared(1, refine_cameras="on", camera_lr=0.05)
    rig, names = own_tiny.capture.rig, own_tiny.reference.header.camera_names
    before = source._cameras.rig.world_to_camera.copy()
    assert not np.allclose(before, rig.subset([rig.names.index(name) for name in names]).world_to_camera, atol=1e-6)
    state = finish(source)
    assert np.array_equal(source._cameras.rig.world_to_camera, before)
    assert CORRECTIONS not in state.arrays  # they are the reference clip's


def test_pictures_are_compared_through_corrected_cameras_and_held_out_ones_are_as_they_were(own_tiny: Tiny) -> None:
    rig, state = own_tiny.capture.rig, own_tiny.reference
    plain = ClipState({k: v for k, v in state.arrays.items() if k != CORRECTIONS}, state.header)
    model = refining(own_tiny).model
    clips = [TrainedClip.of_state(own_tiny.clips[0], model, known, None) for known in (state, plain)]
    for camera, name in enumerate(rig.names):
        views = [clip.view(rig, camera) for clip in clips if clip is not None]
        same = all(bool((getattr(views[0], key) == getattr(views[1], key)).all()) for key in ("world_to_camera", "K"))
        assert same == (name not in state.header.camera_names)


@pytest.mark.parametrize("damage", ["shape", "nan", "type"])
def test_damaged_corrections_are_an_error(own_tiny: Tiny, damage: str) -> None:
    values = own_tiny.reference.arrays[CORRECTIONS].copy()
    if damage == "nan":
        values[0, 0] = np.nan
    changed = {"shape": values[1:], "nan": values, "type": values.astype(np.float64)}[damage]
    state = ClipState(own_tiny.reference.arrays | {CORRECTIONS: changed}, own_tiny.reference.header)
    with pytest.raises(ProjectError, match="corrections"):
        own_tiny.training(1, reference=state)
