"""The rate of playback is what was seen, not what was asked for."""

from __future__ import annotations

import pytest

from ui.viewport.picture_rate import PictureRate, ShownRate


def played(frames: list[tuple[float, int]], now_s: float, *, n_frames: int = 30) -> ShownRate:
    rate = PictureRate()
    for at_s, frame_index in frames:
        rate.note(frame_index, n_frames, at_s)
    return rate.rate(now_s)


def test_only_pictures_that_changed_are_counted():
    """The window draws 60 times a second; the picture changes every fourth of a second and skips seven frames."""
    noted = [(i / 60, (i // 15) * 8 % 30) for i in range(240)]
    seen = played(noted, 4.0)
    assert seen.per_s == pytest.approx(4.0, abs=0.01)
    assert seen.has_skipped


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
        rate.note(i, 30, i / 10)
    rate.stop()
    rate.note(25, 30, 2.0)
    assert rate.rate(2.6) == ShownRate(0.0)
