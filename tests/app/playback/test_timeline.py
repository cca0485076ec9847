"""Frame and clip arithmetic, playing and looping."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.playback.timeline import Timeline
from engine.capture.clip import split_clips

MANY_CLIPS = split_clips(100_000, 10)


def test_an_empty_timeline_stands_still():
    timeline = Timeline()
    timeline.seek(7)
    timeline.toggle_play()
    assert timeline.tick(1.0) is False
    assert (timeline.frame_index, timeline.clip, timeline.is_playing) == (0, None, False)


@given(n_frames=st.integers(1, 300), clip_length=st.integers(1, 40), frame=st.integers(-50, 400))
def test_every_frame_lies_in_exactly_the_clip_that_is_named(n_frames, clip_length, frame):
    timeline = Timeline(split_clips(n_frames, clip_length))
    timeline.seek(frame)
    assert 0 <= timeline.frame_index < n_frames
    assert timeline.clip is not None
    assert timeline.frame_index in timeline.clip.frame_indices()
    assert timeline.clip_of(n_frames) is None
    assert timeline.clip_of(-1) is None


@given(st.lists(st.floats(0.0, 0.2), max_size=60), st.floats(1.0, 120.0))
def test_ticks_add_up_to_the_time_that_passed(ticks, fps):
    timeline = Timeline(MANY_CLIPS, fps=fps)
    timeline.toggle_play()
    for dt_s in ticks:
        timeline.tick(dt_s)
    # less than one frame is carried over; one more allows for the rounding of a sum that ends on a frame
    assert abs(timeline.frame_index - sum(ticks) * fps) <= 1.001


def test_playing_wraps_around_when_looping_and_stops_otherwise():
    timeline = Timeline(split_clips(10, 4), fps=10.0)
    timeline.seek(8)
    timeline.toggle_play()
    timeline.tick(0.3)
    assert (timeline.frame_index, timeline.is_playing) == (1, True)
    timeline.is_looping = False
    timeline.tick(5.0)
    assert (timeline.frame_index, timeline.is_playing) == (9, False)
    timeline.toggle_play()
    assert (timeline.frame_index, timeline.is_playing) == (0, True)


@pytest.mark.parametrize("dt_s", [float("nan"), float("inf"), -1.0, 0.0])
def test_a_strange_clock_moves_nothing(dt_s):
    timeline = Timeline(split_clips(10, 4))
    timeline.toggle_play()
    assert timeline.tick(dt_s) is False
    assert timeline.frame_index == 0


def test_clip_borders():
    timeline = Timeline(split_clips(10, 4))  # clips start at 0, 4 and 8
    assert [timeline.next_clip_start(f) for f in (0, 3, 4, 8)] == [4, 4, 8, 9]
    assert [timeline.previous_clip_start(f) for f in (9, 8, 4, 1, 0)] == [8, 4, 0, 0, 0]


def test_stepping_wraps_only_when_looping():
    timeline = Timeline(split_clips(5, 2))
    timeline.step(-1)
    assert timeline.frame_index == 4
    timeline.is_looping = False
    timeline.step(3)
    assert timeline.frame_index == 4


def test_playing_every_frame_waits_for_each_picture_and_does_not_catch_up():
    timeline = Timeline(split_clips(10, 5), fps=10.0)
    timeline.is_every_frame = True
    timeline.toggle_play()
    assert not timeline.tick(0.5, is_shown=False)
    assert timeline.tick(0.01, is_shown=True)
    assert timeline.frame_index == 1
    visited = []
    for _ in range(4):
        timeline.tick(0.25, is_shown=True)  # slower than the capture: one frame each time, none left out
        visited.append(timeline.frame_index)
    assert visited == [2, 3, 4, 5]
    timeline.tick(0.01, is_shown=True)
    timeline.tick(0.01, is_shown=True)
    assert timeline.frame_index <= 6  # what was lost is not made up for in a hurry


def test_around_a_seam_no_frame_is_left_out_unless_the_user_wants_that():
    timeline = Timeline(split_clips(10, 5), fps=10.0)
    timeline.play_around(5, reach=3)
    assert not timeline.tick(5.0, is_shown=False)
    assert timeline.tick(5.0)
    assert timeline.frame_index == 3
    timeline.toggle_every_frame()
    timeline.tick(0.2, is_shown=False)
    assert timeline.frame_index > 4, "some were left out"
    assert not timeline.is_every_frame, "elsewhere it plays as before"
    timeline.toggle_around()
    timeline.play_around(5, reach=3)
    assert timeline.plays_every_frame


def test_playing_every_frame_is_never_faster_than_the_capture():
    timeline = Timeline(split_clips(20, 5), fps=10.0)
    timeline.is_every_frame = True
    timeline.toggle_play()
    for _ in range(60):
        timeline.tick(1 / 60, is_shown=True)
    assert timeline.frame_index == 10
