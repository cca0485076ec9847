"""Trainings of cameras whose lenses darken the rim: found, taken out, stored, inherited, and shown in pictures."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from engine.capture.capture import Capture
from engine.clip_files.array_names import VIGNETTING
from engine.clip_files.clip_state import ClipState
from engine.cloud.background import vignetting
from engine.errors import ProjectError
from engine.images.rendition import Rendition, log_rims
from tests.engine.training.tiny_training import Tiny, finish, picture, same_arrays, take_steps

LENS = np.array([-0.5, 0.05], np.float32)
N_POINTS = 1500
"""With the 500 of other tiny trainings, which points stereo keeps, and so the processor's rounding, decides a lens."""
STEPS: dict[str, Any] = {"static_steps": 6, "joint_steps": 7, "is_source": False}


@pytest.fixture(scope="module")
def vignetted() -> Iterator[None]:
    """Every camera of a capture with an even number darkens its rim."""
    with pytest.MonkeyPatch.context() as patch:
        original = Capture.frames_of

        def frames_of(self: Capture, camera: int, frames: list[int]) -> np.ndarray:
            pictures = original(self, camera, frames)
            lens = LENS if camera % 2 == 0 else None
            seen = Rendition.of(np.ones(3), lens, self.rig.Ks[camera], self.rig.image_sizes[camera])
            shown = np.stack([seen.to_camera(one / np.float32(255)) for one in pictures])
            return np.floor(shown * 255 + 0.5).astype(np.uint8)

        patch.setattr(Capture, "frames_of", frames_of)
        patch.setattr(vignetting, "MIN_OBSERVATIONS", 40)  # few anchors
        yield


@pytest.fixture(scope="module")
def reference(vignetted: None, tiny: Tiny, tmp_path_factory: pytest.TempPathFactory) -> tuple[ClipState, Path]:
    folder = tmp_path_factory.mktemp("vignetted")
    training = tiny.prepared(0, prep_dir=folder, max_static_points=N_POINTS, **STEPS)
    finish(training)
    return training.finish().state, folder


def lenses_of(tiny: Tiny) -> np.ndarray:
    cameras = tiny.capture.training_cameras(tiny.holdout)
    return np.array([LENS if camera % 2 == 0 else np.zeros(2) for camera in cameras])


def test_the_reference_clip_knows_the_lenses(reference: tuple[ClipState, Path], tiny: Tiny):
    found = reference[0].vignetting
    assert found is not None
    true = np.exp(log_rims(lenses_of(tiny)))  # 0.72 and 1
    # a few dozen points a camera, seen at 80 x 60 pixels
    np.testing.assert_allclose(np.exp(log_rims(found)), true, atol=0.08)


def test_pictures_are_trained_without_and_shown_with_it(reference: tuple[ClipState, Path], tiny: Tiny, vignetted: None):
    state, folder = reference
    training = tiny.prepared(1, reference=state, prep_dir=folder)
    camera = training.camera_indices.index(next(c for c in training.camera_indices if c % 2 == 0))
    taken = tiny.capture.frames_of(training.camera_indices[camera], list(training.clip.frame_indices()))[0]
    seen = training.pictures.picture(camera, 0)
    corner, center = (slice(0, 6), slice(0, 6)), (slice(27, 33), slice(37, 43))
    assert seen[corner].mean() > 1.1 * taken[corner].mean()
    assert seen[center].mean() == pytest.approx(taken[center].mean(), rel=0.03)
    assert state.vignetting is not None
    without = ClipState({k: v for k, v in state.arrays.items() if k != VIGNETTING}, state.header)
    first = next(c for c in range(len(tiny.capture.rig)) if c not in tiny.holdout)  # the camera of `picture`
    row = training.camera_indices.index(first)
    lens = Rendition.of(
        np.ones(3), state.vignetting[row], tiny.capture.rig.Ks[first], tiny.capture.rig.image_sizes[first]
    )
    plain = picture(tiny, without, None)
    np.testing.assert_allclose(picture(tiny, state, None), lens.to_camera(plain), atol=1e-6)


def test_stopped_trainings_go_on_to_the_bit(reference: tuple[ClipState, Path], tiny: Tiny, tmp_path: Path):
    state, folder = reference
    sources: dict[str, Any] = {"reference": state}
    for clip_index, settings in ((0, STEPS), (1, sources)):
        whole = finish(tiny.prepared(clip_index, prep_dir=folder, **settings))
        stopped = take_steps(tiny.prepared(clip_index, prep_dir=folder, **settings), 4)
        stopped.write_checkpoint(tmp_path / "checkpoint")
        resumed = tiny.training(clip_index, prep_dir=folder, **settings)
        resumed.restore_checkpoint(tmp_path / "checkpoint")
        assert same_arrays(finish(resumed).arrays, whole.arrays)


def test_without_colours_of_cameras_lenses_are_left_alone(tiny: Tiny, vignetted: None, tmp_path: Path):
    training = tiny.prepared(0, prep_dir=tmp_path, color="off", **STEPS)
    assert training.vignetting is None
    assert VIGNETTING not in training.state().arrays


@pytest.mark.parametrize(
    "damaged", [np.zeros((3, 2), np.float32), np.full((8, 2), np.nan, np.float32), np.zeros((8, 2), np.float64)]
)
def test_damaged_lenses_are_refused(reference: tuple[ClipState, Path], damaged: np.ndarray):
    state, _ = reference
    with pytest.raises(ProjectError, match="vignetting of the cameras in clip 0"):
        _ = ClipState(state.arrays | {VIGNETTING: damaged}, state.header).vignetting
