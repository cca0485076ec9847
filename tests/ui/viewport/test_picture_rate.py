"""The rate of playback is what was seen, not what was asked for."""

from __future__ import annotations

import pytest

from app.playback.prefetch_order import Course
from ui.viewport.picture_rate import PictureRate, ShownRate

COURSE = Course(first=0, last=29)


def played(frames: list[tuple[float, int]], now_s: float, *, course: Course = COURSE) -> ShownRate:
    rate = PictureRate()
    for at_s, frame_index in frames:
        rate.note(frame_index, course, at_s)
    return rate.rate(now_s)


def test_only_pictures_that_changed_are_counted():
    """The window draws 60 times a second; the picture changes every fourth of a second and skips seven frames."""
    noted = [(i / 60, (i // 15) * 8 % 30) for i in range(240)]
    seen = played(noted, 4.0)
    assert seen.per_s == pytest.approx(4.0, abs=0.01)
    assert (seen.has_skipped, seen.every_nth) == (True, 8)


def test_frames_that_follow_each_other_are_not_skipped_and_the_seam_of_the_loop_is_no_gap():
    noted = [(i / 10, i % 30) for i in range(41)]
    seen = played(noted, 4.0)
    assert seen.per_s == pytest.approx(10.0, abs=0.01)
    assert not seen.has_skipped


def test_no_rate_is_told_before_there_was_time_to_count():
    assert played([(0.0, 0), (0.1, 1)], 0.2).per_s is None
    assert PictureRate().rate(1.0).per_s is None


def test_the_rate_is_that_of_the_last_seconds_and_falls_when_nothing_comes():
    noted = [(i / 10, i) for i in range(20)]
    assert played(noted, 1.9).per_s == pytest.approx(10.0, abs=0.01)
    assert played(noted, 2.9).per_s == pytest.approx(5.4, abs=0.2)  # ten pictures, and none for a second
    assert played(noted, 20.0).per_s == 0.0


def test_stopping_begins_anew():
    rate = PictureRate()
    for i in range(20):
        rate.note(i, COURSE, i / 10)
    rate.stop()
    rate.note(25, COURSE, 2.0)
    assert rate.rate(2.6) == ShownRate(0.0)


def test_backwards_round_a_range_nothing_is_skipped():
    course = Course(direction=-1, first=10, last=14, frames_per_s=15.0)
    seen = played([(i / 10, 14 - i % 5) for i in range(41)], 4.0, course=course)
    assert (seen.has_skipped, seen.every_nth, seen.wanted_per_s) == (False, 1, 15.0)
    seen = played([(i / 10, 14 - 2 * i % 5) for i in range(41)], 4.0, course=course)
    assert (seen.has_skipped, seen.every_nth) == (True, 2)


def test_a_frame_left_out_now_and_then_does_not_make_it_every_second():
    seen = played([(i / 10, (i + i // 8) % 30) for i in range(41)], 4.0)
    assert (seen.has_skipped, seen.every_nth) == (True, 1)
