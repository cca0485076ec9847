"""Frames, seconds and timecode: ticks are round and apart, and what is written is read again as the same frame."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from engine.capture.clip import split_clips
from ui.panels.timeline.jump_text import parse_jump
from ui.panels.timeline.time_range import TimeRange
from ui.panels.timeline.units import (
    FRAMES,
    SECONDS,
    TICK_SPACING,
    TIMECODE,
    UNITS,
    format_time,
    ruler_ticks,
    timecode,
    unit_note,
)

FPS = st.sampled_from([1.0, 10.0, 12.5, 23.976, 24.0, 25.0, 29.97, 30.0, 50.0, 59.94, 60.0, 119.88, 240.0])
CLIPS = split_clips(2_000_001, 100)


@given(
    start=st.floats(0.0, 900_000.0),
    length=st.floats(4.0, 900_000.0),
    width=st.floats(120.0, 4000.0),
    fps=FPS,
    unit=st.sampled_from(UNITS),
)
def test_ticks_are_apart_in_sight_and_each_has_its_own_label(start, length, width, fps, unit):
    n_frames = int(start + length) + 1
    ticks = ruler_ticks(TimeRange(start, start + length), width, fps, unit, n_frames)
    steps = [after - before for before, after in zip(ticks.positions, ticks.positions[1:], strict=False)]
    assert all(step * width / length >= TICK_SPACING[unit] * (1 - 1e-6) for step in steps)
    assert len({*ticks.labels}) == len(ticks.labels) == len(ticks.positions)
    assert len(ticks.positions) <= width / TICK_SPACING[unit] + 3
    assert all(0 <= position <= n_frames - 1 + 1e-6 for position in ticks.positions)


def test_ticks_stand_at_round_numbers():
    ticks = ruler_ticks(TimeRange(0.0, 300.0), 800.0, 30.0, FRAMES, 300)
    assert ticks.labels[:3] == ("0", "50", "100")
    ticks = ruler_ticks(TimeRange(0.0, 300.0), 800.0, 30.0, SECONDS, 300)
    assert (ticks.labels[:3], ticks.positions[1]) == (("0", "1", "2"), 30.0)
    ticks = ruler_ticks(TimeRange(0.0, 30.0), 800.0, 30.0, SECONDS, 300)
    assert ticks.labels[:3] == ("0.0", "0.1", "0.2")
    ticks = ruler_ticks(TimeRange(0.0, 300.0), 800.0, 29.97, TIMECODE, 300)
    assert ticks.labels[:2] == ("00:00:00:00", "00:00:02:00")


@given(frame_index=st.integers(0, 2_000_000), fps=FPS, unit=st.sampled_from(UNITS))
def test_what_is_written_is_read_as_the_same_frame(frame_index, fps, unit):
    text = format_time(frame_index, fps, unit)
    jump = parse_jump(text, 0, CLIPS, fps)
    assert jump.words == ""
    # hundredths of a second cannot tell frames of a faster capture apart
    off = max(1, round(0.01 * fps)) if unit == SECONDS else 0
    assert abs(jump.frame_index - frame_index) <= off


def test_a_timecode_counts_whole_frames_and_says_when_that_is_not_the_time_of_day():
    assert timecode(30 * 3661 + 7, 29.97) == "01:01:01:07"
    assert timecode(239, 240.0) == "00:00:00:239"
    assert "non-drop" in unit_note(TIMECODE, 29.97)
    assert "30 frames to the second" in unit_note(TIMECODE, 29.97)
    assert "non-drop" not in unit_note(TIMECODE, 25.0)
    assert "29.97" in unit_note(SECONDS, 29.97)


@pytest.mark.parametrize(
    ("text", "frame_index"),
    [
        ("120", 120),
        (" 120 ", 120),
        ("12.5s", 375),
        (".5 s", 15),
        ("3 sec", 90),
        ("00:00:02:03", 63),
        ("2:03", 63),
        ("clip 7", 70),
        ("Clip7", 70),
        ("+10", 60),
        ("- 50", 0),
    ],
)
def test_where_a_typed_time_leads(text, frame_index):
    assert parse_jump(text, 50, split_clips(1000, 10), 30.0).frame_index == frame_index


@pytest.mark.parametrize(
    ("text", "frame_index"),
    [("5000", 999), ("99999s", 999), ("-60", 0), ("clip 100", 990), ("9" * 39, 999), ("99:00:00:00", 999)],
)
def test_what_lies_outside_leads_to_the_end_and_says_so(text, frame_index):
    jump = parse_jump(text, 50, split_clips(1000, 10), 30.0)
    assert (jump.frame_index, bool(jump.words)) == (frame_index, True)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "   ",
        "abc",
        "1,5",
        "clip",
        "clip x",
        "1:2:3:4:5",
        "00:00:00:30",
        "00:61:00:00",
        "1e9",
        "nan",
        "s",
        "²",
        "%s",
        "9" * 400,
        "::",
        "--1",
        "12.5",
        "٣",
    ],
)
def test_what_is_not_a_time_leads_nowhere_and_says_what_one_is(text):
    jump = parse_jump(text, 50, split_clips(1000, 10), 30.0)
    assert jump.frame_index is None
    assert len(jump.words) > 20


@given(st.text(max_size=60))
def test_any_text_is_answered(text):
    jump = parse_jump(text, 3, split_clips(50, 7), 29.97)
    if jump.frame_index is None:
        assert jump.words
    else:
        assert 0 <= jump.frame_index < 50


def test_without_a_capture_there_is_nowhere_to_go():
    assert parse_jump("3", 0, [], 30.0).frame_index is None
