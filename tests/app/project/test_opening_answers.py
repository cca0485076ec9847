"""What a project of a capture is offered to begin with, and what of it the next capture is offered."""

from __future__ import annotations

import pytest

from app.project.opening.opening_answers import (
    LastAnswers,
    OpeningAnswers,
    answers_to_keep,
    default_answers,
    working_size,
)
from engine.capture.capture import open_capture
from engine.errors import CaptureError
from tests.app.fakes import write_capture


def test_answers_offered_fit_the_capture(capture_folder):
    offered = default_answers(open_capture(capture_folder))
    assert offered == OpeningAnswers(frames=None, scale=1.0, clip_length=6, holdout=("0",))
    small = default_answers(open_capture(capture_folder), LastAnswers(16, 4, is_holding_out=False))
    assert small == OpeningAnswers(frames=None, scale=0.5, clip_length=4, holdout=())


def test_what_is_kept_of_answers_says_something_about_other_captures(capture_folder):
    capture = open_capture(capture_folder)
    assert answers_to_keep(OpeningAnswers((1, 3), 0.5, 2, ("1",)), capture) == LastAnswers(16, 2, is_holding_out=True)
    assert answers_to_keep(OpeningAnswers(None, 1.0, 6, ()), capture) == LastAnswers(None, 6, is_holding_out=False)


def test_the_size_that_is_told_is_the_one_that_is_worked_on(tmp_path):
    capture = open_capture(write_capture(tmp_path / "odd", size=(37, 23)))
    for scale in (1.0, 0.7, 0.33):
        assert working_size(capture, scale) == tuple(capture.resized(scale).rig.image_sizes[0])
    with pytest.raises(CaptureError, match="scale"):
        working_size(capture, 0.0)
    with pytest.raises(CaptureError, match="no pixels"):
        working_size(capture, 0.001)
