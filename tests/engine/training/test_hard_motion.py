"""What rests and then moves, what leaves and comes, what is uncovered late, and a scene in which everything moves.

Regions are known from the scene, figures are pooled over all nine cameras. What a test asks for lies one or more
decibels below what came out when it was written (one seed; the figures are named), because few steps leave a lot to
chance.

Limits that these scenes show: what rested in the reference clip and goes leaves a hull of its own shape behind, on
which the clip paints what lies behind it. That does not look like a ghost, but is 3 to 6 dB worse than floor that was
always free, from cameras in between most of all; and a small thing that appears inside such a hull comes out dull when
it has a colour that frozen heads have never seen.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.engine.training.hard_scenes import (
    ENTERING,
    LEAVING,
    LID,
    RESTING,
    TREASURE,
    all_moving,
    coming_and_going,
    lifted_lid,
)
from tests.engine.training.hard_stage import CLIP_LENGTH
from tests.engine.training.hard_training import Trained, pooled_psnr, train_scene

pytestmark = pytest.mark.slow

FIRST, SECOND, THIRD = (range(clip * CLIP_LENGTH, (clip + 1) * CLIP_LENGTH) for clip in range(3))
ROLLING = 1


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory):
    return tmp_path_factory.mktemp("hard_motion")


@pytest.fixture(scope="module")
def traffic(folder) -> Trained:
    return train_scene(coming_and_going(), folder / "traffic")


@pytest.fixture(scope="module")
def lid(folder) -> Trained:
    return train_scene(lifted_lid(), folder / "lid", source_steps=300)


def gain(trained: Trained, frames, *things: int) -> float:
    """By how many decibels the picture of these things is better than that of the static anchors alone."""

    def shown(camera: int, frame: int) -> np.ndarray:
        return trained.scene.shows(camera, frame, *things)

    return pooled_psnr(trained, frames, shown) - pooled_psnr(trained, frames, shown, static_only=True)


def where_it_was(trained: Trained, thing: int, frame_before: int):
    """Pixels of bare floor that this thing covered at an earlier frame."""
    scene = trained.scene
    return lambda camera, frame: scene.shows(camera, frame_before, thing) & scene.floor(camera, frame)


def free_floor(trained: Trained, thing: int, frame_before: int):
    """Pixels of bare floor that it did not cover."""
    scene = trained.scene
    return lambda camera, frame: ~scene.shows(camera, frame_before, thing) & scene.floor(camera, frame)


def test_what_moves_in_both_clips_is_shown_in_both(traffic):
    assert gain(traffic, FIRST, ROLLING) > 5.0
    assert gain(traffic, SECOND, ROLLING) > 4.0


def test_what_moved_and_left_leaves_nothing_behind(traffic):
    gone = where_it_was(traffic, LEAVING, CLIP_LENGTH - 1)
    assert gain(traffic, FIRST, LEAVING) > 4.0
    still = pooled_psnr(traffic, SECOND, gone, static_only=True)
    assert pooled_psnr(traffic, SECOND, gone) > still - 0.5  # it is not there: as the floor itself


def test_what_rested_and_left_is_painted_over(traffic):
    # 28.8 dB; the static anchors alone, with its ghost, 15.8; free floor 36.7
    gone = where_it_was(traffic, RESTING, 0)
    found = pooled_psnr(traffic, SECOND, gone)
    assert found > pooled_psnr(traffic, SECOND, gone, static_only=True) + 9.0
    assert found > 28.0
    assert pooled_psnr(traffic, SECOND, free_floor(traffic, RESTING, 0)) > 34.0


def test_what_enters_in_the_middle_of_a_clip_is_there_from_then_on_and_not_before(traffic):
    assert gain(traffic, SECOND[2:], ENTERING) > 7.0  # 25.4 against 13.3 dB in the held-out camera

    def to_come(camera: int, frame: int) -> np.ndarray:
        return traffic.scene.shows(camera, CLIP_LENGTH + 2, ENTERING) & traffic.scene.floor(camera, frame)

    still = pooled_psnr(traffic, SECOND[:2], to_come, static_only=True)
    assert pooled_psnr(traffic, SECOND[:2], to_come) > still - 0.5


def test_what_rests_is_part_of_the_still_scene(lid):
    for frames in (FIRST, SECOND):
        assert abs(gain(lid, frames, LID)) < 0.3


def test_and_moves_when_it_does(lid):
    assert gain(lid, THIRD[1:], LID) > 3.0  # 18 to 21 against 14 dB


def test_where_it_stood_it_is_gone(lid):
    # 26.1 dB after 160 steps, its ghost 17.5
    gone = where_it_was(lid, LID, 0)
    assert pooled_psnr(lid, THIRD[1:], gone) > pooled_psnr(lid, THIRD[1:], gone, static_only=True) + 6.0


def test_what_it_covered_comes_to_light(lid):
    assert gain(lid, THIRD[1:], TREASURE) > 2.5  # 19.8 against 14.6 dB


def test_where_everything_moves_the_picture_is_no_worse_than_a_still_one(folder):
    """A floor that slides has no background: its mean over time stands for it. What crosses it still moves."""
    trained = train_scene(all_moving(), folder / "all_moving")
    assert gain(trained, range(8), 0) > 5.0  # the ball: 20 to 25 against 12.5 dB

    def floor(camera: int, frame: int) -> np.ndarray:
        return trained.scene.floor(camera, frame)

    found, still = (pooled_psnr(trained, range(8), floor, static_only=static_only) for static_only in (False, True))
    assert found > still - 0.5
    assert found > 22.0
