"""Zoom and pan: what is under the pointer stays there, and nothing leaves the capture."""

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from ui.panels.timeline.time_range import MIN_SHOWN_FRAMES, TimeRange, TimeScale, range_around, whole_range

N_FRAMES = st.integers(1, 20_000)
POSITION = st.floats(-100.0, 25_000.0)


def ranges(n_frames: int) -> st.SearchStrategy[TimeRange]:
    ends = st.tuples(POSITION, st.floats(0.01, 30_000.0))
    return ends.map(lambda ends: TimeRange(ends[0], ends[0] + ends[1]).within(n_frames))


def assert_inside(shown: TimeRange, n_frames: int) -> None:
    assert shown.start >= 0.0
    assert shown.stop <= n_frames + 1e-6
    assert min(MIN_SHOWN_FRAMES, n_frames) - 1e-6 <= shown.length <= n_frames + 1e-6


@given(st.data(), N_FRAMES)
def test_whatever_is_done_what_is_shown_lies_in_the_capture(data, n_frames):
    shown = data.draw(ranges(n_frames))
    assert_inside(shown, n_frames)
    assert_inside(shown.zoomed(data.draw(st.floats(0.01, 100.0)), data.draw(POSITION), n_frames), n_frames)
    assert_inside(shown.panned(data.draw(st.floats(-1e5, 1e5)), n_frames), n_frames)
    first = data.draw(st.integers(0, n_frames - 1))
    assert_inside(range_around(first, data.draw(st.integers(first + 1, n_frames)), n_frames), n_frames)
    assert_inside(shown.showing(data.draw(st.integers(0, n_frames - 1)), n_frames), n_frames)


@given(st.data(), st.integers(100, 20_000), st.floats(0.3, 3.0), st.floats(0.0, 1.0))
def test_what_is_under_the_pointer_stays_there(data, n_frames, factor, share):
    shown = data.draw(ranges(n_frames))
    at = shown.start + share * shown.length
    zoomed = shown.zoomed(factor, at, n_frames)
    is_free = zoomed.start > 1e-6 and zoomed.stop < n_frames - 1e-6
    assume(is_free)
    assert (at - zoomed.start) / zoomed.length == pytest.approx(share, abs=1e-6)


@given(st.data(), N_FRAMES)
def test_a_page_is_turned_only_to_what_is_out_of_sight_and_keeps_the_zoom(data, n_frames):
    shown = data.draw(ranges(n_frames))
    frame_index = data.draw(st.integers(0, n_frames - 1))
    page = shown.showing(frame_index, n_frames)
    assert page.start - 1e-6 <= frame_index
    assert frame_index + 1 <= page.stop + 1e-6
    assert page.length == pytest.approx(shown.length)
    if shown.start <= frame_index <= shown.stop - 1:
        assert page is shown


def test_pages_follow_a_playhead_that_runs_either_way():
    shown = TimeRange(10.0, 30.0)
    assert shown.showing(30, 100) == TimeRange(30.0, 50.0)
    assert shown.showing(9, 100) == TimeRange(0.0, 20.0)
    assert TimeRange(50.0, 70.0).showing(49, 100) == TimeRange(30.0, 50.0)


def test_zooming_in_and_out_again_ends_where_it_began():
    shown = TimeRange(200.0, 400.0)
    again = shown.zoomed(1.25, 260.0, 1000).zoomed(0.8, 260.0, 1000)
    assert (again.start, again.stop) == (pytest.approx(200.0), pytest.approx(400.0))
    assert whole_range(1000).zoomed(0.5, 300.0, 1000) == whole_range(1000)
    assert whole_range(1000).covers(1000)
    assert not shown.covers(1000)


@given(st.data(), N_FRAMES, st.floats(-1.0, 2.0))
def test_the_frame_under_the_pointer_is_inside_the_capture_and_its_cell(data, n_frames, share):
    scale = TimeScale(10.0, 910.0, data.draw(ranges(n_frames)), n_frames)
    x = scale.x0 + share * scale.width
    frame_index = scale.frame_at(x)
    assert 0 <= frame_index < n_frames
    if 0 <= share < 1:
        # a thousandth of a pixel: rounding of the division at cell borders
        assert scale.left_of(frame_index) <= x + 1e-3
        assert x <= scale.left_of(frame_index + 1) + 1e-3
    assert scale.position_at(scale.left_of(frame_index)) == pytest.approx(frame_index, abs=1e-6)


def test_without_frames_there_is_still_a_scale():
    assert TimeScale(0.0, 100.0, whole_range(0), 0).frame_at(50.0) == 0
