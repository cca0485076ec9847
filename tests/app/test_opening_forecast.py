"""What training a capture takes, told before there is a project."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.plan.opening_forecast import forecast_opening, free_mb
from app.project.opening.opening_answers import OpeningAnswers
from engine.capture.capture import open_capture
from engine.errors import PreparationError


def forecast(folder, answers, step_s: float | None = 0.01):
    return forecast_opening(open_capture(folder), answers, step_time=lambda sizes, phase: step_s, place=Path("/"))


def test_it_follows_from_the_answers(capture_folder):
    whole = forecast(capture_folder, OpeningAnswers(None, 1.0, 2, ("0",)))
    assert (whole.n_clips, whole.size, whole.n_pictures) == (3, (32, 24), 18)
    part = forecast(capture_folder, OpeningAnswers((1, 4), 0.5, 2, ()))
    assert (part.n_clips, part.size, part.n_pictures) == (2, (16, 12), 12)
    assert part.disk_mb < whole.disk_mb
    assert part.total_s is not None
    assert whole.total_s is not None
    assert part.total_s < whole.total_s
    assert whole.reference_s is not None
    assert whole.reference_s < whole.total_s
    assert whole.memory_mb is not None


def test_without_a_step_that_was_timed_only_time_is_unknown(capture_folder):
    found = forecast(capture_folder, OpeningAnswers(None, 1.0, 2, ()), step_s=None)
    assert found.total_s is None
    assert found.disk_mb > 0


def test_too_few_cameras_are_refused(capture_folder):
    with pytest.raises(PreparationError, match="Only 1 cameras"):
        forecast(capture_folder, OpeningAnswers(None, 1.0, 2, ("0", "1", "2")))


def test_room_is_known_for_a_folder_that_is_not_there_yet(tmp_path):
    assert free_mb(tmp_path / "a" / "b") == pytest.approx(free_mb(tmp_path), rel=0.01)
