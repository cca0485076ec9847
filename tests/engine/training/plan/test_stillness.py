"""looks_still: a clip in which nothing moves is recognised before it is trained, a moving one at its first picture."""

from __future__ import annotations

from dataclasses import replace

import pytest
from safetensors.numpy import load_file

from engine.training.config import TrainConfig
from engine.training.plan.stillness import looks_still
from engine.training.preparation.cloud_preparation import BACKGROUNDS_FILE
from tests.engine.training.tiny_training import SIZES


class Noted:
    """Frames by a function of camera and frame; notes which were asked for."""

    def __init__(self, picture):
        self._picture = picture
        self.asked = []

    def frames(self, camera_index, frame_indices):
        for frame_index in frame_indices:
            self.asked.append((camera_index, frame_index))
            yield self._picture(camera_index, frame_index)

    def valid(self, camera_index):
        return None

    def moving_mask(self, camera_index, frame_index):
        return None


@pytest.fixture
def look(tiny):
    """Look at clip 1 of the tiny capture as if the cameras had taken other pictures. Returns answer and store."""
    cameras = [camera for camera in range(len(tiny.capture.rig)) if camera not in tiny.holdout]
    backgrounds = dict(zip(cameras, load_file(tiny.prep_dir / BACKGROUNDS_FILE)["images"], strict=True))

    def run(picture="as it is", *, clip=tiny.clips[1], prep_dir=tiny.prep_dir, **settings):
        store = Noted(tiny.capture.frame)
        if picture == "still":
            store = Noted(lambda camera, frame: backgrounds[camera])
        elif picture == "late":  # something white comes into the last camera's picture of the first frame
            white = backgrounds[cameras[-1]].copy()
            white[20:40, 20:40] = 255
            at = (cameras[-1], clip.start)
            store = Noted(lambda camera, frame: white if (camera, frame) == at else backgrounds[camera])
        config = TrainConfig(**(SIZES | settings))
        return looks_still(replace(tiny.capture, store=store), clip, cameras, config, prep_dir), store.asked

    return run


@pytest.fixture
def n_cameras(tiny):
    """Training cameras of the tiny capture."""
    return len(tiny.capture.rig) - len(tiny.holdout)


def test_what_moves_is_seen_in_the_first_pictures(look, n_cameras):
    is_still, asked = look()
    assert not is_still
    assert len(asked) <= n_cameras


def test_a_clip_of_backgrounds_is_still(look, tiny, n_cameras):
    is_still, asked = look("still")
    assert is_still
    start = tiny.clips[1].start
    assert {frame - start for _, frame in asked} == {0, 1, 3}
    assert len(asked) == 3 * n_cameras
    one_frame = replace(tiny.clips[1], n_frames=1)
    is_still, asked = look("still", clip=one_frame)
    assert is_still
    assert len(asked) == n_cameras


def test_one_picture_in_which_something_moves_is_enough(look):
    assert not look("late")[0]


def test_nobody_knows_without_backgrounds_of_the_same_settings(look, tmp_path):
    assert look("still", prep_dir=tmp_path) == (False, [])
    assert look("still", background_frames=7) == (False, [])


@pytest.mark.parametrize(
    "settings",
    [{"gate": "off"}, {"inherit": "trainable"}, {"decoder": "new"}, {"field": "continue"}],
)
def test_what_learns_without_motion_is_never_still(look, settings):
    assert look("still", **settings) == (False, [])
