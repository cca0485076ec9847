"""Backgrounds and motion masks on small made-up pictures with known answers."""

from __future__ import annotations

import numpy as np
import pytest

from engine.cloud.background.background import estimate_background
from engine.cloud.background.masks import motion_mask
from engine.cloud.background.recheck import recheck_background
from engine.images.image_filters import block_mean, blurred_difference, dilate, erode, remove_small_blobs


def noisy_frames(n_frames: int, wall: np.ndarray, seed: int = 0) -> np.ndarray:
    """A textured wall with camera noise of 2 grey levels. [T, H, W, 3] uint8"""
    noise = np.random.default_rng(seed).normal(0.0, 2.0, (n_frames, *wall.shape))
    return np.clip(wall + noise, 0, 255).astype(np.uint8)


@pytest.fixture
def wall() -> np.ndarray:
    return np.random.default_rng(7).uniform(60.0, 200.0, (48, 64, 3))


def test_background_is_the_wall_although_someone_stands_there_for_a_while(wall: np.ndarray) -> None:
    frames = noisy_frames(40, wall)
    sway = np.random.default_rng(3).normal(0.0, 15.0, (18, 20, 20, 3))  # cloth moves far more than the sensor's noise
    frames[:18, 10:30, 20:40] = np.clip(230.0 + sway, 0, 255)
    background = estimate_background(frames)
    error = np.abs(background.image.astype(float) - wall)
    assert np.median(error) < 1.5  # mean of >= 22 samples of sigma 2 plus rounding: about 0.5
    assert (error.max(-1) < 12).mean() > 0.99
    assert background.is_stable[:, 44:].mean() > 0.99


def test_background_marks_pixels_without_a_majority_as_unstable(wall: np.ndarray) -> None:
    frames = noisy_frames(40, wall)
    frames[:26, 10:30, 20:40] = np.random.default_rng(3).integers(0, 255, (26, 20, 20, 3))
    is_stable = estimate_background(frames).is_stable
    assert not is_stable[12:28, 22:38].any()
    assert is_stable[35:, :].mean() > 0.98


def test_what_appears_later_and_stays_is_not_background(wall: np.ndarray) -> None:
    frames = noisy_frames(30, wall)
    box = np.random.default_rng(5).uniform(20.0, 240.0, (20, 20, 3))
    frames[10:, 10:30, 20:40] = noisy_frames(20, box, seed=9)
    background = estimate_background(frames)
    error = np.abs(background.image[10:30, 20:40].astype(float) - wall[10:30, 20:40]).max(-1)
    assert (error < 12).mean() > 0.9
    assert not background.is_stable[12:28, 22:38].any()


def test_background_of_one_or_two_frames_is_their_mean_trusted_where_they_agree() -> None:
    frames = np.stack([np.full((40, 50, 3), 10, np.uint8), np.full((40, 50, 3), 20, np.uint8)])
    frames[1, :, :25] = 12
    background = estimate_background(frames)
    assert (background.image[:, :25] == 11).all()
    assert (background.image[:, 25:] == 15).all()
    assert background.is_stable[:, :20].all()
    assert not background.is_stable[:, 30:].any()
    single = estimate_background(frames[1:])
    assert np.array_equal(single.image, frames[1])
    assert single.is_stable.all()


def test_background_does_not_depend_on_thread_timing(wall: np.ndarray) -> None:
    frames = noisy_frames(12, wall)
    first, second = estimate_background(frames), estimate_background(frames)
    assert np.array_equal(first.image, second.image)
    assert np.array_equal(first.is_stable, second.is_stable)


def test_motion_mask_finds_a_moving_square_and_nothing_else() -> None:
    wall = np.full((120, 160, 3), 120.0)
    frame = noisy_frames(1, wall)[0]
    frame[40:70, 50:90] = (200, 80, 60)
    mask = motion_mask(frame, wall)
    truth = np.zeros_like(mask)
    truth[40:70, 50:90] = True
    assert mask[truth].all()
    assert not (mask & ~dilate(truth, 1)).any()  # the blur may grow the square by a pixel
    assert not mask[:30].any()
    assert not mask[80:].any()


def test_motion_mask_threshold_follows_the_cameras_noise() -> None:
    wall = np.full((120, 160, 3), 120.0)
    noise = np.random.default_rng(1).normal(0.0, 25.0, wall.shape)
    frame = np.clip(wall + noise, 0, 255).astype(np.uint8)
    assert motion_mask(frame, wall).mean() < 0.02
    assert motion_mask(frame, wall, threshold=5.0).mean() > 0.5


def test_recheck_removes_a_ghost_that_the_frames_disprove(wall: np.ndarray) -> None:
    wall = np.kron(wall[:12, :16], np.ones((8, 8, 1)))  # 96 x 128, smooth enough for a soft render
    background = wall.astype(np.uint8)
    background[30:60, 40:70] = 250
    is_stable = np.ones(wall.shape[:2], bool)
    is_stable[30:60, 40:70] = False
    frames = noisy_frames(6, wall)
    corrected = recheck_background(background, is_stable, wall / 255.0, frames)
    assert np.abs(corrected[32:58, 42:68].astype(float) - wall[32:58, 42:68]).mean() < 3.0
    assert np.array_equal(corrected[:20], background[:20])


def test_recheck_believes_stable_pixels_far_from_any_ghost_and_ignores_nan() -> None:
    background = np.full((96, 128, 3), 100, np.uint8)
    is_stable = np.ones((96, 128), bool)
    render = np.full((96, 128, 3), 100 / 255.0)
    render[20:60, 20:60] = 1.0
    render[70:90, 70:90] = np.nan
    frames = np.repeat(background[None], 3, axis=0)
    assert np.array_equal(recheck_background(background, is_stable, render, frames), background)


def test_morphology_matches_a_brute_force_window() -> None:
    mask = np.random.default_rng(2).random((17, 23)) < 0.15
    for radius in (1, 3):
        padded = np.pad(mask, radius)
        windows = np.lib.stride_tricks.sliding_window_view(padded, (2 * radius + 1, 2 * radius + 1))
        assert np.array_equal(dilate(mask, radius), windows.any((2, 3)))
        inside = np.pad(mask, radius, constant_values=True)
        windows = np.lib.stride_tricks.sliding_window_view(inside, (2 * radius + 1, 2 * radius + 1))
        assert np.array_equal(erode(mask, radius), windows.all((2, 3)))


def test_small_blobs_go_and_large_ones_stay() -> None:
    mask = np.zeros((20, 20), bool)
    mask[1:3, 1:3] = True
    mask[10:15, 10:15] = True
    kept = remove_small_blobs(mask, 5)
    assert kept.sum() == 25
    assert remove_small_blobs(np.zeros((4, 4), bool), 1).sum() == 0


def test_block_mean_cuts_the_remainder() -> None:
    image = np.arange(5 * 7).reshape(5, 7).astype(np.float32)
    assert np.allclose(block_mean(image, 2)[0, 0], (0 + 1 + 7 + 8) / 4)
    assert block_mean(image, 2).shape == (2, 3)


def test_blurred_difference_of_a_constant_offset_is_that_offset() -> None:
    frame = np.full((9, 11, 3), 110, np.uint8)
    difference = blurred_difference(frame, np.full((9, 11, 3), 100.0), 1.0)
    assert np.allclose(difference, 30.0, atol=1e-3)  # float32 sums of 7 x 7 taps
