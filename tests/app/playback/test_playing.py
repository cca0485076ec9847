"""Playing both ways, at every speed, between two frames and around a seam; no time is lost or won."""

import math
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.document.project_document import Marker
from app.playback.markers import Markers
from app.playback.timeline import SEAM_REACH, SPEEDS, Timeline
from engine.capture.clip import split_clips

MANY_CLIPS = split_clips(1_000_000, 100)


def timeline_of(n_frames: int = 100, fps: float = 10.0) -> Timeline:
    return Timeline(split_clips(n_frames, 10), fps=fps)


@given(
    ticks=st.lists(st.floats(1e-6, 0.3), min_size=1, max_size=80),
    fps=st.sampled_from([23.976, 24.0, 25.0, 29.97, 30.0, 60.0, 119.88]),
    speed=st.sampled_from(SPEEDS),
    direction=st.sampled_from([1, -1]),
)
def test_the_frames_gone_are_those_of_the_time_that_passed(ticks, fps, speed, direction):
    timeline = Timeline(MANY_CLIPS, fps=fps)
    timeline.speed = speed
    timeline.seek(500_000)
    timeline.shuttle(direction)
    timeline.speed = speed
    for dt_s in ticks:
        timeline.tick(dt_s)
    due = sum(Fraction(dt_s) for dt_s in ticks) * Fraction(fps) * Fraction(speed)
    gone = (timeline.frame_index - 500_000) * direction
    assert math.floor(due - Fraction(1, 10**6)) <= gone <= math.floor(due + Fraction(1, 10**6))


def test_an_hour_of_ticks_ends_on_the_frame():
    timeline = Timeline(MANY_CLIPS, fps=29.97)
    timeline.toggle_play()
    for _ in range(3600 * 60):
        timeline.tick(1 / 60)
    assert abs(timeline.frame_index - 3600 * 29.97) < 1.001


def test_a_change_of_speed_keeps_the_part_of_a_frame_that_was_gone():
    timeline = timeline_of()
    timeline.toggle_play()
    timeline.tick(0.09)
    timeline.change_speed(1)
    assert timeline.tick(0.005), "0.9 of a frame and 0.1 of a frame"
    assert timeline.frame_index == 1


def test_playing_backward_wraps_when_looping_and_stops_otherwise():
    timeline = timeline_of(10)
    timeline.seek(1)
    timeline.shuttle(-1)
    timeline.tick(0.3)
    assert (timeline.frame_index, timeline.is_playing) == (8, True)
    timeline.is_looping = False
    timeline.tick(5.0)
    assert (timeline.frame_index, timeline.is_playing) == (0, False)
    timeline.shuttle(-1)
    assert (timeline.frame_index, timeline.is_playing) == (9, True)


def test_the_shuttle_speeds_up_slows_down_and_turns():
    timeline = timeline_of()
    speeds = []
    for direction in (1, 1, 1, 1, -1, -1):
        timeline.shuttle(direction)
        speeds.append(timeline.speed * timeline.direction)
    assert speeds == [1.0, 2.0, 4.0, 4.0, -1.0, -2.0]
    timeline.hold()
    assert not timeline.is_playing
    timeline.speed = 0.25
    timeline.shuttle(1)
    assert timeline.speed == 0.25, "slow motion that was chosen stays"
    for _ in range(9):
        timeline.change_speed(-1)
    assert timeline.speed == SPEEDS[0]


@given(
    n_frames=st.integers(2, 60),
    ends=st.tuples(st.none() | st.integers(-5, 80), st.none() | st.integers(-5, 80)),
    start=st.integers(0, 80),
    direction=st.sampled_from([1, -1]),
    is_looping=st.booleans(),
    ticks=st.lists(st.floats(0.01, 3.0), max_size=20),
)
def test_playing_never_leaves_its_range(n_frames, ends, start, direction, is_looping, ticks):
    timeline = timeline_of(n_frames)
    timeline.is_looping = is_looping
    timeline.set_range(*ends)
    first, last = timeline.play_range
    assert 0 <= first <= last < n_frames
    timeline.seek(start)
    timeline.shuttle(direction)
    assert first <= timeline.frame_index <= last
    for dt_s in ticks:
        timeline.tick(dt_s)
        assert first <= timeline.frame_index <= last
    assert timeline.is_playing or not is_looping


def test_in_and_out_give_way_to_each_other():
    timeline = timeline_of()
    timeline.seek(40)
    timeline.set_out()
    timeline.seek(20)
    timeline.set_in()
    assert timeline.play_range == (20, 40)
    timeline.seek(60)
    timeline.set_in()
    assert (timeline.in_frame, timeline.out_frame) == (60, None)
    timeline.set_out()
    timeline.seek(10)
    timeline.set_out()
    assert (timeline.in_frame, timeline.out_frame) == (None, 10)
    timeline.clear_range()
    assert timeline.play_range == (0, 99)


@pytest.mark.parametrize(
    ("frame", "seam"), [(0, 10), (4, 10), (14, 10), (16, 20), (94, 90), (99, 90)], ids=lambda value: str(value)
)
def test_the_nearest_seam_is_that_of_the_nearest_clip_boundary(frame, seam):
    timeline = timeline_of()
    timeline.seek(frame)
    assert timeline.nearest_seam == seam


def test_around_a_seam_is_played_over_and_over_until_the_user_goes_elsewhere():
    timeline = timeline_of()
    timeline.is_looping = False
    timeline.set_range(0, 5)
    timeline.seek(31)
    timeline.toggle_around()
    assert timeline.around == (30 - SEAM_REACH, 30 + SEAM_REACH - 1)
    assert (timeline.frame_index, timeline.is_playing) == (18, True)
    timeline.tick(2.5)  # 25 frames: once round and one on
    assert (timeline.frame_index, timeline.is_playing) == (19, True)
    timeline.seek(20)
    assert timeline.around is not None, "within it the user may look where he likes"
    timeline.seek(70)
    assert timeline.around is None
    assert timeline.play_range == (0, 5)
    timeline.toggle_around()
    timeline.toggle_around()
    assert (timeline.around, timeline.is_playing) == (None, False)


def test_a_single_clip_has_no_seam_to_play_around():
    timeline = timeline_of(8)
    timeline.toggle_around()
    assert (timeline.around, timeline.is_playing) == (None, False)


def test_who_moves_the_playhead_or_plays_follows_no_more():
    for act in (lambda timeline: timeline.seek(5), Timeline.toggle_play, Timeline.toggle_around):
        timeline = timeline_of()
        timeline.is_following = True
        timeline.go_to(50)
        assert timeline.is_following
        act(timeline)
        assert not timeline.is_following


def test_the_same_frames_in_other_clips_keep_what_the_user_has_set():
    timeline, other = timeline_of(50), Timeline(split_clips(50, 7), fps=10.0)
    timeline.markers = Markers([Marker(20, "foul")])
    timeline.set_range(5, 30)
    timeline.speed, timeline.is_looping = 0.5, False
    timeline.seek(22)
    other.take_over(timeline)
    assert (other.frame_index, other.play_range, other.speed, other.is_looping) == (22, (5, 30), 0.5, False)
    assert other.markers.frames == [20]
