"""Captures in which nothing moves, or of which little is known: still scenes, clips of one frame, a single picture."""

from __future__ import annotations

import numpy as np
import pytest

from tests.engine.training.hard_scenes import all_still, one_frame_clips
from tests.engine.training.hard_stage import HEIGHT, N_CAMERAS, WIDTH
from tests.engine.training.hard_training import Trained, pooled_psnr, train_scene

pytestmark = pytest.mark.slow

MAX_BYTES = 2_000
"""Of a clip in which nothing is new: names and numbers of its header. It took 840."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory):
    return tmp_path_factory.mktemp("hard_still")


@pytest.fixture(scope="module")
def still(folder) -> Trained:
    return train_scene(all_still(), folder / "all_still")


def everywhere(_camera: int, _frame: int) -> np.ndarray:
    return np.ones((HEIGHT, WIDTH), dtype=bool)


def test_where_nothing_moves_a_later_clip_takes_no_step_and_no_room(still):
    training = still.trainings[1]
    assert training.n_steps == 0
    assert training.model.field is None
    assert training.model.roles() == ["static"]
    assert still.n_bytes(1) < MAX_BYTES
    assert "0 steps instead of 160" in still.said[1]["Nothing to learn"]


def test_where_nothing_moves_no_pixel_ever_changes(still):
    for camera in range(N_CAMERAS):
        first = still.picture(camera, 0)
        assert all(np.array_equal(still.picture(camera, frame), first) for frame in range(1, still.scene.n_frames))


def test_the_still_picture_is_good(still):
    assert pooled_psnr(still, range(8), everywhere) > 25.0  # 28.5 dB in the held-out camera


@pytest.fixture(scope="module")
def jumps(folder) -> Trained:
    return train_scene(one_frame_clips(), folder / "one_frame")


def test_clips_of_one_frame_are_trained_and_read_back(jumps):
    for frame in range(3):

        def ball(camera: int, _frame: int, now: int = frame) -> np.ndarray:
            return jumps.scene.shows(camera, now, 1)

        still = pooled_psnr(jumps, [frame], ball, static_only=True)
        assert pooled_psnr(jumps, [frame], ball) > still + 4.0
        assert jumps.states[frame].header.n_frames == 1


def test_the_ball_is_only_where_it_is(jumps):
    for frame in (1, 2):

        def before(camera: int, now: int) -> np.ndarray:
            return jumps.scene.shows(camera, now - 1, 1) & jumps.scene.floor(camera, now)

        assert pooled_psnr(jumps, [frame], before) > 22.0


def test_two_pictures_a_camera_are_enough_for_what_stands_still(folder):
    """With fewer than three frames nobody can say what is background; where they agree, all of it is."""
    trained = train_scene(one_frame_clips(2), folder / "two_frames")

    def floor(camera: int, frame: int) -> np.ndarray:
        return trained.scene.floor(camera, frame)

    assert pooled_psnr(trained, range(2), floor) > 22.0
