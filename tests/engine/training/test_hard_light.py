"""Light that changes where nothing moves: lamps, a slow shadow, and a camera whose exposure drifts.

What the tests ask for is a few decibels or a share of the light less than what came out when they were written (one
seed; the figures are named), because a hundred and sixty steps leave a lot to chance.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from tests.engine.training.hard_scenes import (
    DRIFTING,
    EARLY_SPOT,
    LATE_SPOT,
    drifting_exposure,
    in_shadow_way,
    lamps,
    plain,
    slow_shadow,
)
from tests.engine.training.hard_stage import CLIP_LENGTH, HEIGHT, N_CAMERAS, WIDTH
from tests.engine.training.hard_training import Trained, pooled_psnr, train_scene

pytestmark = pytest.mark.slow

FIRST, SECOND = range(CLIP_LENGTH), range(CLIP_LENGTH, 2 * CLIP_LENGTH)
BEFORE, AFTER = SECOND[:2], SECOND[2:]
"""Frames of clip 1 before and after the late lamp is switched on."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory):
    return tmp_path_factory.mktemp("hard_light")


@pytest.fixture(scope="module")
def lit(folder) -> Trained:
    return train_scene(lamps(), folder / "lamps")


def under(trained: Trained, light):
    """Pixels of the floor that get at least half of this light."""
    return lambda camera, frame: (trained.scene.floor_under(camera, light) >= 0.5) & trained.scene.floor(camera, frame)


def share_of_light(trained: Trained, light, frame: int) -> float:
    """How much of what a lamp adds to the mean brightness of its spot the pictures show."""
    shown, true, dark = np.zeros(3)
    for camera in range(N_CAMERAS):
        spot = under(trained, light)(camera, frame) & trained.scene.floor(camera, 0)
        shown += trained.picture(camera, frame)[spot].sum()
        true += trained.truth(camera, frame)[spot].sum()
        dark += trained.truth(camera, 0)[spot].sum()
    return float((shown - dark) / (true - dark))


def test_a_lamp_that_was_switched_on_between_clips_shines(lit):
    # 23.3 dB, 15.2 without it; 0.7 of the light
    chosen = under(lit, EARLY_SPOT)
    assert pooled_psnr(lit, SECOND, chosen) > pooled_psnr(lit, SECOND, chosen, static_only=True) + 5.0
    assert all(share_of_light(lit, EARLY_SPOT, frame) > 0.5 for frame in SECOND)


def test_a_lamp_that_is_switched_on_inside_a_clip_shines_from_then_on(lit):
    # 23.1 dB, 15.1 without it; 0.7 of the light
    chosen = under(lit, LATE_SPOT)
    assert pooled_psnr(lit, AFTER, chosen) > pooled_psnr(lit, AFTER, chosen, static_only=True) + 5.0
    assert all(share_of_light(lit, LATE_SPOT, frame) > 0.5 for frame in AFTER)


def test_and_not_before(lit):
    # without the lamp nothing stands there, so not a bit differs but for what reaches over from elsewhere
    chosen = under(lit, LATE_SPOT)
    still = pooled_psnr(lit, BEFORE, chosen, static_only=True)
    assert pooled_psnr(lit, BEFORE, chosen) > still - 0.5
    chosen = under(lit, EARLY_SPOT)
    assert pooled_psnr(lit, FIRST, chosen) > pooled_psnr(lit, FIRST, chosen, static_only=True) - 0.5


def test_a_slow_shadow_is_followed(folder):
    # 29 to 35 dB in the pictures, 17 to 23 without what learned; the held-out camera alone the same
    trained = train_scene(slow_shadow(), folder / "shadow")
    chosen = under(trained, in_shadow_way)
    for frame in range(trained.scene.n_frames):
        still = pooled_psnr(trained, [frame], chosen, static_only=True)
        assert pooled_psnr(trained, [frame], chosen) > still + 3.0


# ---------------------------------------------------------------- exposure


@pytest.fixture(scope="module")
def steady(folder) -> Trained:
    return train_scene(plain(), folder / "plain", joint_steps=400)


@pytest.fixture(scope="module")
def drifted(folder) -> Trained:
    return train_scene(drifting_exposure(), folder / "drift", joint_steps=400)


def everywhere(_camera: int, _frame: int) -> np.ndarray:
    return np.ones((HEIGHT, WIDTH), dtype=bool)


def test_the_other_cameras_do_not_suffer(steady, drifted):
    # 30.9 and 30.5 dB without the drift, 31.1 and 30.6 with it
    others = [camera for camera in range(N_CAMERAS) if camera != DRIFTING]
    for frames in (FIRST, SECOND):
        without = pooled_psnr(steady, frames, everywhere, cameras=others)
        assert pooled_psnr(drifted, frames, everywhere, cameras=others) > without - 0.7


def test_the_camera_that_drifts_is_followed(steady, drifted):
    for frames in (FIRST, SECOND):
        without = pooled_psnr(steady, frames, everywhere, cameras=[DRIFTING])
        brighter_db = 20 * np.log10(1.0 + 0.03 * np.mean(frames))  # errors grow with the exposure
        # in the second clip 30.0 dB, 31.2 without the drift, of which the exposure itself explains 1.3
        assert pooled_psnr(drifted, frames, everywhere, cameras=[DRIFTING]) > without - brighter_db - 0.7


def test_what_does_not_move_keeps_its_bits_beside_what_does(steady):
    """From frame to frame and over the border of the clips; some anchors of the ball reach beyond it."""
    ways = [np.any([steady.scene.shows(camera, frame, 1) for frame in range(8)], axis=0) for camera in range(N_CAMERAS)]
    for camera in (0, 4):
        pictures = [steady.picture(camera, frame) for frame in range(8)]
        for one, other in pairwise(pictures):
            assert (one == other).all(axis=-1)[~ways[camera]].mean() > 0.95  # 0.985
