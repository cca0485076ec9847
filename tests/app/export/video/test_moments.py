"""Moments: slow motion goes through the frames in order, and nothing lies behind the last one."""

from __future__ import annotations

import pytest

from app.export.video.moments import Moment, moments_of
from engine.capture.files.frame_runs import runs_of


@pytest.mark.parametrize(
    ("n_frames", "step", "expected"),
    [
        (3, 1.0, [0, 1, 2]),
        (3, 0.5, [0, 0.5, 1, 1.5, 2]),
        (4, 2.0, [0, 2]),
        (4, 0.75, [0, 0.75, 1.5, 2.25, 3.0]),
        (1, 0.1, [0]),
        (2, 5.0, [0]),
    ],
)
def test_moments_lie_a_step_apart(n_frames: int, step: float, expected: list[float]):
    moments = moments_of([range(7, 7 + n_frames)], step)
    assert [moment.scene for moment in moments] == pytest.approx([7 + frame for frame in expected])
    assert all(moment.scene == moment.view for moment in moments)


def test_steps_that_binary_numbers_do_not_know_still_meet_the_frames():
    moments = moments_of([range(0, 31)], 0.1)
    assert len(moments) == 301
    assert [moment.scene for moment in moments[::10]] == list(range(31))
    assert [moment.is_whole for moment in moments[:11]] == [True, *[False] * 9, True]


def test_gaps_are_jumped_over_and_time_can_stand_still():
    runs = runs_of([0, 1, 2, 6, 7])
    assert runs == [range(0, 3), range(6, 8)]
    assert [moment.scene for moment in moments_of(runs, 1.0)] == [0, 1, 2, 6, 7]
    held = moments_of(runs, 1.0, hold=1.5)
    assert held == [Moment(1.5, float(view)) for view in (0, 1, 2, 6, 7)]
