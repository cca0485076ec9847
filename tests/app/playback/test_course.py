"""Course: the next frames in the direction of play, and which frames are far."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from app.playback.prefetch_order import Course
from app.playback.timeline import Timeline
from engine.capture.clip import split_clips


def test_it_is_that_of_the_timeline():
    timeline = Timeline(split_clips(20, 10), fps=25.0)
    timeline.seek(7)
    assert Course.of(timeline) == Course(7, 1, 0, 19, is_looping=True, is_playing=False, frames_per_s=25.0)


def test_the_next_frames_go_round_and_end_before_the_playhead_comes_again():
    course = Course(frame_index=8, first=5, last=9)
    assert course.ahead(3) == [9, 5, 6]
    assert course.ahead(50) == [9, 5, 6, 7]
    assert replace(course, direction=-1).ahead(5) == [7, 6, 5, 9]


def test_without_a_loop_they_end_where_playing_does():
    course = Course(frame_index=8, first=5, last=10, is_looping=False)
    assert course.ahead(9) == [9, 10]
    assert replace(course, direction=-1).ahead(9) == [7, 6, 5]
    assert replace(course, frame_index=10).ahead(9) == []


def test_outside_of_what_is_played_nothing_wraps():
    assert Course(frame_index=2, first=5, last=9).ahead(4) == [3, 4, 5, 6]
    assert Course(frame_index=12, first=5, last=9).ahead(4) == []


def test_while_it_plays_round_the_frame_just_passed_is_the_farthest():
    course = Course(frame_index=8, first=5, last=9, is_playing=True)
    assert [course.distance(frame) for frame in (8, 9, 5, 6, 7)] == [0, 1, 2, 3, 4]
    assert course.distance(20) > course.distance(7)
    assert course.distance(0) > course.distance(7)


def test_while_it_stands_what_was_passed_is_near_too():
    course = Course(frame_index=8, first=0, last=100)
    assert course.distance(7) < course.distance(11) < course.distance(6)


@given(
    st.integers(0, 30), st.integers(0, 30), st.integers(0, 30), st.sampled_from([1, -1]), st.booleans(), st.booleans()
)
def test_frames_ahead_are_in_order_of_distance(
    start: int, end: int, at: int, direction: int, is_looping: bool, is_playing: bool
):
    first, last = sorted((start, end))
    course = Course(at, direction, first, last, is_looping, is_playing)
    ahead = course.ahead(12)
    assert len(set(ahead)) == len(ahead)
    assert at not in ahead
    if first <= at <= last and is_playing:
        distances = [course.distance(frame) for frame in ahead]
        assert distances == sorted(distances)
        assert all(first <= frame <= last for frame in ahead)
