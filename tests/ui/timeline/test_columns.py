"""Columns of clips, thinned to what can be seen: nothing that matters is left out."""

import itertools

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from app.status import SEAM_RATIO_FLAGGED, ClipStatus, ResidualStatus, SeamStatus
from ui.panels.timeline.clip_words import STATE_WORDS
from ui.panels.timeline.rows.columns import (
    STATES,
    clip_columns,
    frame_psnr,
    group_size,
    largest_of_groups,
    means_of_groups,
    merged_spans,
    runs_of,
    seam_ratios,
)
from ui.panels.timeline.rows.seam_lane import HIGHEST, LOWEST, ratio_text, seam_color
from ui.panels.timeline.view_state import TimelineView


def test_every_state_has_a_place_and_words():
    assert {*STATES} == {*STATE_WORDS}
    columns = clip_columns([ClipStatus("failed"), ClipStatus("trained", 1.0, 30.5), ClipStatus("of another version")])
    assert [STATES[code] for code in columns.states] == ["failed", "trained", "untrained"]
    np.testing.assert_array_equal(columns.psnr, np.array([np.nan, 30.5, np.nan], np.float32))


@given(st.lists(st.sampled_from([0.0, 1.5, 2.5, np.nan]), max_size=40), st.integers(1, 9))
def test_of_a_group_the_largest_counts_and_one_that_is_not_measured_least(values, size):
    largest = largest_of_groups(np.array(values, np.float32), size)
    groups = [values[start : start + size] for start in range(0, len(values), size)]
    for found, group in zip(largest, groups, strict=True):
        measured = [value for value in group if value == value]
        assert found == max(measured) if measured else np.isnan(found)


@given(st.lists(st.sampled_from([0.0, 1.5, np.nan]), max_size=40))
def test_runs_cover_everything_once_and_have_one_value(values):
    array = np.array(values)
    runs = runs_of(array)
    assert [place for first, last in runs for place in range(first, last + 1)] == [*range(len(values))]
    for first, last in runs:
        np.testing.assert_array_equal(array[first : last + 1], array[first])
    for (_, last), (first, _) in itertools.pairwise(runs):
        assert not np.array_equal(array[last], array[first], equal_nan=True)


def test_groups_are_as_wide_as_asked():
    assert [group_size(width, 2.0) for width in (5.0, 2.0, 1.9, 0.5, 0.0)][:4] == [1, 1, 2, 4]


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(1, 5)), max_size=30))
def test_spans_are_joined_where_the_gap_cannot_be_seen(pairs):
    starts, stops, at = [], [], 0
    for gap, length in pairs:
        starts.append(at + gap)
        stops.append(at + gap + length)
        at += gap + length
    spans = merged_spans(np.array(starts, float), np.array(stops, float), 2.0)
    covered = {place for start, stop in zip(starts, stops, strict=True) for place in range(start, stop)}
    drawn = {place for start, stop in spans for place in range(int(start), int(stop))}
    assert covered <= drawn
    assert len(drawn - covered) <= len(starts)
    assert all(after[0] - before[1] >= 2.0 for before, after in itertools.pairwise(spans))


def test_ratios_belong_to_the_boundary_before_their_clip():
    seams = [
        SeamStatus(2, 20, 0.1, 1.4),
        SeamStatus(3, 30),
        SeamStatus(99, 990, 0.9, 3.0),
        SeamStatus(0, 0, 0.9, 3.0),
        SeamStatus(4, 40, 0.9),  # nothing changes inside, and much at the boundary
        SeamStatus(5, 50, 0.01),
        SeamStatus(6, 60, 0.9, 2.6, 5, 31),  # most cameras are missing
    ]
    nan = np.nan
    expected = np.array([nan, nan, 1.4, nan, HIGHEST, LOWEST, nan], np.float32)
    np.testing.assert_array_equal(seam_ratios(seams, 7), expected)


def test_a_ratio_has_the_same_colour_everywhere_and_brighter_is_worse():
    lightness = [
        0.2126 * color[0] + 0.7152 * color[1] + 0.0722 * color[2]
        for color in (seam_color(ratio) for ratio in np.linspace(LOWEST, HIGHEST, 20))
    ]
    assert (np.diff(lightness) > 0).all()
    assert seam_color(-5.0) == seam_color(LOWEST)
    assert seam_color(99.0) == seam_color(HIGHEST)
    assert [ratio_text(ratio) for ratio in (1.04, SEAM_RATIO_FLAGGED, 2.04, 3.4)] == ["1.0", "2.0", "2.0!", "3.4!"]


def test_columns_are_made_anew_only_when_a_clip_has_changed():
    view, states = TimelineView(), [ClipStatus("trained", 1.0, 30.0), ClipStatus()]
    columns = view.columns(states)
    assert view.columns([*states]) is columns
    states[1] = ClipStatus("training", 0.5)
    assert STATES[view.columns(states).states[1]] == "training"
    seams = [SeamStatus(1, 10, 0.1, 2.5)]
    ratios = view.ratios(seams, 2)
    assert view.ratios(seams, 2) is ratios
    seams[0] = SeamStatus(1, 10, 0.1, 1.5)
    assert view.ratios(seams, 2)[1] == 1.5


def test_the_quality_of_a_frame_is_the_mean_of_its_held_out_cameras():
    cells = np.array([[30.0, 20.0, 34.0], [np.nan, 20.0, 34.0], [np.nan, 20.0, np.nan]], np.float32)
    status = ResidualStatus(cells={"psnr": cells}, is_held_out=(True, False, True))
    np.testing.assert_array_equal(frame_psnr(status), np.array([32.0, 34.0, np.nan], np.float32))
    nobody = ResidualStatus(cells={"psnr": cells}, is_held_out=(False, False, False))
    np.testing.assert_array_equal(frame_psnr(nobody), np.array([28.0, 27.0, 20.0], np.float32))
    assert frame_psnr(ResidualStatus()).shape == (0,)


@given(st.lists(st.sampled_from([0.0, 2.0, 4.0, np.nan]), max_size=40), st.integers(1, 9))
def test_of_a_group_the_mean_is_that_of_what_was_measured(values, size):
    means = means_of_groups(np.array(values, np.float32), size)
    groups = [values[start : start + size] for start in range(0, len(values), size)]
    for found, group in zip(means, groups, strict=True):
        measured = [value for value in group if value == value]
        assert np.isnan(found) if not measured else abs(found - sum(measured) / len(measured)) < 1e-5
