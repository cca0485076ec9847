"""Boundaries that were made bad on purpose, mended: the short version of tests.benchmarks.bench_mending.

Exposure: three cameras of a finished clip are written down 12 % brighter than they are. Shift: what one camera took is
moved by two pixels while a clip is trained in which furniture may move.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from engine.backends.table import backend_called
from engine.clip_files.array_names import LOG_DRIFT
from engine.clip_files.clip_state import ClipState
from engine.clip_files.compact import compact_clip
from engine.errors import ProjectError
from engine.gate.regions import sphere_region
from engine.mending.figures import MAX_PSNR_LOSS_DB
from engine.mending.measuring import Threads
from engine.mending.mend import Mended, StretchMending
from engine.mending.stretch import boundary_stretch, frames_stretch
from engine.mending.targets import FadedPictures, Looks
from engine.metrics.clips.trained_clip import TrainedClip
from engine.model.reading import load_clip_model
from engine.training.clip_training import ClipTraining
from engine.training.config import TrainConfig
from tests.engine.training.tiny_training import CLIP_LENGTH, Tiny, finish, same_arrays

pytestmark = pytest.mark.slow

FURNITURE = (sphere_region("dynamic", (1.0, 0.75, 0.28), 0.5), sphere_region("dynamic", (-0.35, -0.3, 0.25), 0.5))


@dataclass(frozen=True)
class Case:
    """A capture with its first clips."""

    tiny: Tiny
    states: dict[int, ClipState]

    def make(self, clip_index: int, config: TrainConfig) -> ClipTraining:
        settings: dict[str, Any] = config.difference()
        return self.tiny.training(clip_index, **settings)

    def mending(self, after: int = 1) -> StretchMending:
        return self.of(boundary_stretch(self.tiny.clips, after))

    def of(self, stretch: Any) -> StretchMending:
        tiny = self.tiny
        return StretchMending(
            tiny.capture,
            stretch,
            tiny.clips,
            self.states,
            tiny.reference,
            holdout=tiny.holdout,
            make_training=self.make,
            backend=backend_called("cpu"),
            threads=Threads(1),
        )

    def shown(self) -> dict[int, TrainedClip]:
        found = {}
        for index, state in self.states.items():
            model = load_clip_model(state, self.tiny.reference, backend=backend_called("cpu"))
            trained = TrainedClip.of_state(self.tiny.clips[index], model, state, self.tiny.reference)
            assert trained is not None
            found[index] = trained
        return found


@pytest.fixture(scope="module")
def trained(tiny: Tiny) -> ClipState:
    """Clip 1 as it is trained."""
    training = tiny.prepared(1)
    finish(training)
    return training.finish().state


def brightened(tiny: Tiny, state: ClipState) -> ClipState:
    """The same clip, in which three cameras count as 12 % brighter than they are."""
    drift = np.zeros((len(state.header.camera_names), CLIP_LENGTH, 3), np.float32)
    if LOG_DRIFT in state.arrays:
        drift = state.arrays[LOG_DRIFT].copy()
    drift[1::3] += 0.12
    return compact_clip(ClipState(state.arrays | {LOG_DRIFT: drift}, state.header)).state


def test_wrong_exposure_of_some_cameras_is_measured_again(tiny: Tiny, trained: ClipState) -> None:
    case = Case(tiny, {0: tiny.reference, 1: brightened(tiny, trained)})
    mended = case.mending().run()
    assert_mended(mended)
    assert [attempt.method for attempt in mended.attempts if attempt.is_kept] == ["light"]
    assert mended.diagnosis.colors > 0.5 * mended.diagnosis.all
    drift = mended.clips[1].state.drift
    assert drift is None or np.abs(np.log(drift)).max() < 0.03, "the cameras are as bright as they are"
    header = mended.clips[1].state.header
    assert (header.step, header.config) == (trained.header.step, trained.header.config), "it was not trained anew"
    assert header.reference_fingerprint == tiny.reference.header.fingerprint
    assert header.figures.held_out_whole == (header.figures.held_out_psnr is not None), "over every frame"
    assert header.origin == case.states[1].header.fingerprint, "what was picked in it stays picked"


def test_a_shifted_camera_is_outweighed_by_the_clip_beside(tiny: Tiny) -> None:
    training = tiny.prepared(1, regions=FURNITURE, source_steps=60)
    pixels = training.pictures._pixels
    pixels.put(2, np.roll(pixels.of_camera(2), 4, axis=2))  # with 2, one seed or processor in two is not mended
    finish(training)
    case = Case(tiny, {0: tiny.reference, 1: training.finish().state})
    mended = case.mending().run()
    assert_mended(mended, left=0.75)  # of trainings of a second; half and less where clips are trained well
    assert set(mended.clips) == {1}, "the reference stays as it is"


def assert_mended(mended: Mended, *, left: float = 0.5) -> None:
    before, after = mended.before, mended.after
    assert before.excess is not None
    assert after.excess is not None
    assert before.excess > 0.1, "it was made bad"
    assert after.excess <= left * before.excess
    assert all(after.psnr[index] >= before.psnr[index] - MAX_PSNR_LOSS_DB for index in before.psnr)
    assert after.is_enough(before) == (not mended.advice)


def test_a_way_that_does_not_help_changes_nothing(tiny: Tiny, trained: ClipState) -> None:
    case = Case(tiny, {0: tiny.reference, 1: trained})
    mended = case.mending().run("light")  # it was measured well
    assert not mended.clips
    assert mended.after == mended.before
    assert not any(attempt.is_kept for attempt in mended.attempts)


def test_the_reference_clip_and_clips_that_are_not_there_are_refused(tiny: Tiny, trained: ClipState) -> None:
    with pytest.raises(ProjectError, match="reference"):
        Case(tiny, {0: tiny.reference, 1: trained}).of(frames_stretch(tiny.clips, 1, 3))
    with pytest.raises(ProjectError, match="Clip 1 is not trained"):
        Case(tiny, {0: tiny.reference}).mending()


def test_a_fade_goes_evenly_from_one_look_to_the_other(tiny: Tiny, trained: ClipState, tmp_path: Path) -> None:
    case = Case(tiny, {0: tiny.reference, 1: brightened(tiny, trained)})
    cameras = tiny.capture.training_cameras(tiny.holdout)
    looks = Looks(tiny.capture, case.shown(), cameras)
    clip = tiny.clips[1]
    span = range(clip.start, clip.start + 2)
    pictures = FadedPictures(tiny.capture, clip, cameras, tmp_path, looks, span)
    is_still = looks.still_between(0, span.start - 1, span.stop)
    assert 0.3 < is_still.mean() < 1.0
    start, end = looks.look(0, span.start - 1), looks.look(0, span.stop)
    assert start is not None
    assert end is not None
    for step, frame in enumerate(span, start=1):
        wanted = np.clip(start + (end - start) * step / 3, 0, 1)
        assert np.allclose(pictures.picture(0, frame - clip.start)[is_still], wanted[is_still], atol=1e-5)
    assert np.allclose(pictures.picture(0, span.stop - clip.start), np.clip(end, 0, 1))


@pytest.mark.parametrize("position_lr", [0.0, 1e-3])
def test_taking_up_a_clip_changes_nothing_before_the_first_step(
    tiny: Tiny, trained: ClipState, position_lr: float
) -> None:
    training = tiny.training(1, position_lr=position_lr)
    case = Case(tiny, {0: tiny.reference, 1: trained})
    looks = Looks(tiny.capture, case.shown(), training.camera_indices)
    clip = tiny.clips[1]
    pictures = FadedPictures(
        tiny.capture, clip, training.camera_indices, training.prep_dir, looks, range(clip.start, clip.start + 1)
    )
    training.take_up(trained, pictures, [0, 1], n_steps=3, learning=("field.",))
    assert same_arrays(training.state().arrays, trained.arrays)
    first = {name: array.copy() for name, array in training.state().arrays.items()}
    while not training.is_finished:
        training.step()
    changed = {name for name, array in training.state().arrays.items() if not np.array_equal(array, first[name])}
    assert changed
    assert all(name.startswith("field.") for name in changed), "nothing else was allowed to learn"
