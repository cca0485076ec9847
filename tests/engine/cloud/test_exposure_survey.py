"""The look at the exposure of a whole capture: curves, steps, and what is left out where there is too much."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from engine.capture.capture import Capture
from engine.cloud.background import exposure_survey
from engine.cloud.background.exposure_survey import ExposureCurve, survey_exposure
from engine.errors import CaptureError

SIZE = (48, 64)


class Rig:
    """Names and how many."""

    def __init__(self, n_cameras: int) -> None:
        self.names = tuple(f"cam{i}" for i in range(n_cameras))

    def __len__(self) -> int:
        return len(self.names)


def capture_of(n_cameras: int, n_frames: int, gain: Callable[[int, int], Any]) -> Capture:
    """A capture whose cameras look at a still wall with a person in front of it; `gain` is of a camera and frame."""
    wall = np.random.default_rng(1).uniform(40, 180, (*SIZE, 3))

    def frame(camera: int, index: int) -> np.ndarray:
        picture = wall.copy()
        picture[10:40, 5 + index % 40 : 15 + index % 40] = 90 + 10 * (index % 3)
        return np.clip(picture * gain(camera, index) + 0.5, 0, 255).astype(np.uint8)

    return cast(Capture, SimpleNamespace(rig=Rig(n_cameras), n_frames=n_frames, frame=frame))


def curve_of(levels: list[float]) -> ExposureCurve:
    gains = 1.0 + np.array(levels)[:, None] * np.ones(3)
    return ExposureCurve(tuple(range(0, 10 * len(levels), 10)), gains)


def test_the_curve_is_what_the_camera_did():
    def gain(camera: int, frame: int) -> float:
        return 1.0 if camera == 0 else 1.0 + 0.001 * frame * camera

    found = survey_exposure(capture_of(3, 100, gain))
    assert (found.n_cameras, found.n_left_out, len(found.frames)) == (3, 0, 12)
    assert (found.frames[0], found.frames[-1]) == (0, 99)
    assert [curve.has_changed for curve in found.curves.values()] == [False, True, True]
    for camera, curve in enumerate(found.curves.values()):
        assert curve.levels == pytest.approx([0.001 * frame * camera for frame in found.frames], abs=0.003)
        assert curve.steps == ()


def test_a_jump_of_a_calm_curve_is_a_step():
    found = survey_exposure(capture_of(1, 100, lambda _, frame: 1.0 if frame < 50 else 0.94))
    ((before, after, change),) = found.curves["cam0"].steps
    assert before < 50 <= after
    assert (before, after) in pairwise(found.frames)
    assert change == pytest.approx(-0.06, abs=0.005)


@pytest.mark.parametrize(
    "levels",
    [
        [0.0, 0.01, 0.02, 0.03, 0.04],  # a slope
        [0.0, 0.03, 0.0, 0.03, 0.0],  # nothing is calm
        [0.0, 0.025, 0.01, 0.025, 0.035],  # as restless as it jumps
        [0.0, 0.0, 0.018, 0.018, 0.018],  # too small
        [0.0, 0.05],  # no rest to tell it from
    ],
)
def test_other_changes_are_no_step(levels):
    assert curve_of(levels).steps == ()


def test_colours_that_drift_apart_count_as_a_change_although_the_brightness_stays():
    tint = np.array([1.02, 1.0, 1.0 / 1.02])
    found = survey_exposure(capture_of(1, 8, lambda _, frame: tint if frame > 3 else 1.0))
    curve = found.curves["cam0"]
    assert np.abs(curve.levels).max() < 0.004
    assert curve.has_changed
    assert curve.color_shift == pytest.approx(1.02**2 - 1, abs=0.006)


def test_of_very_many_cameras_fewer_pictures_are_looked_at(monkeypatch):
    monkeypatch.setattr(exposure_survey, "MAX_PICTURES", 40)
    looked: list[tuple[int, int]] = []

    def gain(camera: int, frame: int) -> float:
        looked.append((camera, frame))
        return 1.0

    found = survey_exposure(capture_of(25, 1000, gain))
    assert len(looked) == 40
    assert (len(found.frames), len(found.curves), found.n_left_out, found.is_late) == (4, 10, 15, False)
    cameras = sorted({camera for camera, _ in looked})
    assert max(b - a for a, b in pairwise(cameras)) <= 5, "they are spread over the rig"


def test_what_takes_too_long_is_left_out_but_one_camera_is_always_measured():
    times = iter(range(10**6))
    found = survey_exposure(capture_of(30, 12, lambda *_: 1.0), clock=lambda: 10.0 * next(times))
    assert found.is_late
    assert list(found.curves) == ["cam0"]


def test_pictures_that_cannot_be_read_are_said_and_do_not_stop_the_others():
    def gain(camera: int, frame: int) -> float:
        if camera == 1 and frame > 5:
            raise CaptureError("The image is missing.")
        return 1.0

    found = survey_exposure(capture_of(3, 12, gain))
    assert found.unreadable == {"cam1": "The image is missing."}
    assert (list(found.curves), found.n_left_out) == (["cam0", "cam2"], 0)
