"""Frozen, black, repeated and moving pictures are found, and nothing where there is nothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, shift

from app.lab.synthetic.rigs import make_rig
from engine.camera.rig import CameraRig
from engine.doctor.alignment import align
from engine.doctor.checks.black import check_black
from engine.doctor.checks.frozen import check_frozen
from engine.doctor.checks.movement import check_movement
from engine.doctor.picture_survey import CameraLook, PictureSurvey, frames_to_look_at, median_picture

N_FRAMES = 24


@dataclass
class _Capture:
    rig: CameraRig


def room(seed: int, size: tuple[int, int] = (96, 128)) -> np.ndarray:
    """A still picture with edges. [h, w] 0..255"""
    rng = np.random.default_rng(seed)
    return np.clip(128 + 260 * gaussian_filter(rng.normal(size=size), 2.5), 10, 245)


def film(camera: int, n_frames: int = N_FRAMES) -> np.ndarray:
    """A bright square that crosses a still room, with noise. [T, h, w] uint8"""
    rng = np.random.default_rng(100 + camera)
    frames = np.repeat(room(camera)[None], n_frames, axis=0) + rng.normal(0, 0.7, (n_frames, 96, 128))
    for t in range(n_frames):
        frames[t, 30:50, 2 * t + 10 : 2 * t + 30] = 250
    return np.clip(frames + 0.5, 0, 255).astype(np.uint8)


def look_of(films: list[np.ndarray]) -> PictureSurvey:
    n_frames = len(films[0])
    frames, spread = frames_to_look_at(n_frames, len(films))
    assert frames == tuple(range(n_frames))
    cameras = tuple(
        CameraLook(one, one[list(spread)], np.ones((len(spread), 3)), np.repeat(one[0][:, :, None], 3, 2))
        for one in films
    )
    return PictureSurvey(_Capture(make_rig(len(films), (128, 96))), frames, spread, cameras, {})  # type: ignore[arg-type]


@pytest.mark.slow
def test_films_in_which_all_goes_well_raise_no_alarm() -> None:
    look = look_of([film(camera) for camera in range(5)])
    assert check_frozen(look) == check_black(look) == check_movement(look) == []


def test_a_camera_that_freezes_is_named_with_its_frames() -> None:
    films = [film(camera) for camera in range(5)]
    films[2][10:14] = films[2][9]
    (finding,) = check_frozen(look_of(films))
    assert (finding.kind, finding.cameras, finding.frames) == ("frozen", ("cam02",), (10, 11, 12, 13))
    assert finding.fix is not None
    assert finding.fix.is_excluded == {"cam02": True}
    assert [picture.frame for picture in finding.evidence] == [9, 10]


def test_moments_that_all_cameras_show_twice_are_told_once() -> None:
    films = [film(camera) for camera in range(4)]
    for one in films:
        one[5::5] = one[4::5][: len(one[5::5])]
    (finding,) = check_frozen(look_of(films))
    assert (finding.kind, finding.cameras, finding.frames) == ("repeated", (), (5, 10, 15, 20))
    assert "every 5 frames" in finding.text


def test_where_nothing_moves_nothing_is_frozen() -> None:
    films = [np.repeat(film(camera)[:1], N_FRAMES, axis=0) for camera in range(4)]
    assert check_frozen(look_of(films)) == []


@pytest.mark.parametrize(("value", "word"), [(3, "black"), (253, "white")])
def test_empty_pictures_are_told_and_not_called_frozen(value, word) -> None:
    films = [film(camera) for camera in range(4)]
    films[1][:3] = value
    look = look_of(films)
    (finding,) = check_black(look)
    assert (finding.kind, finding.cameras, finding.frames) == (word, ("cam01",), (0, 1, 2))
    assert finding.severity == "warning"
    assert check_frozen(look) == []
    films[1][:] = value
    (finding,) = check_black(look_of(films))
    assert finding.severity == "error"


def test_a_camera_that_is_knocked_is_named_with_how_far_and_when() -> None:
    films = [film(camera) for camera in range(3)]
    films[1][14:] = np.roll(films[1][14:], 3, axis=2)
    (finding,) = check_movement(look_of(films))
    assert (finding.kind, finding.cameras) == ("moves", ("cam01",))
    assert "up to 3.0 px" in finding.text or "up to 2.9 px" in finding.text
    before, after = (int(word.rstrip(".")) for word in finding.text.split("frames ")[-1].split(" and "))
    assert before < 14 <= after


@pytest.mark.parametrize("offset", [(0.0, 0.0), (0.0, 1.4), (-2.6, 4.2)])
def test_alignment_measures_a_shift_in_spite_of_somebody_who_passes(offset) -> None:
    first = room(4)
    second = shift(first, offset, order=3, mode="nearest")
    second[20:60, 70:100] = 240
    found = align(first.astype(np.uint8), np.clip(second, 0, 255).astype(np.uint8))
    assert found.shift_px == pytest.approx(float(np.hypot(*offset)), abs=0.15)


def test_alignment_of_plain_walls_says_nothing() -> None:
    wall = np.full((60, 80), 120, np.uint8)
    assert align(wall, wall).shift_px == 0.0


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 6])
def test_the_median_of_pictures_is_that_of_numpy(n) -> None:
    pictures = np.random.default_rng(n).integers(0, 256, (n, 5, 7, 3)).astype(np.uint8)
    expected = np.sort(pictures, axis=0)[(n - 1) // 2]
    np.testing.assert_array_equal(median_picture(list(pictures)), expected)


def test_of_a_long_capture_runs_are_looked_at() -> None:
    frames, spread = frames_to_look_at(10_000, 36)
    assert 16 <= len(frames) <= 60
    assert frames[0] == 0
    assert frames[-1] == 9999
    steps = np.diff(frames)
    assert (steps > 0).all()
    assert (steps == 1).sum() >= 0.7 * len(steps)
    assert set(spread) <= set(frames)
    assert (spread[0], spread[-1]) == (0, 9999)
    assert frames_to_look_at(1, 3) == ((0,), (0,))
