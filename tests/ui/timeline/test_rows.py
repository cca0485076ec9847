"""Rows share the height of the panel, and give way in a stated order."""

import itertools

from hypothesis import given
from hypothesis import strategies as st

from ui.panels.timeline.rows.rows import (
    CACHE,
    CAMERA,
    CLIPS,
    HEIGHTS,
    KEPT_FIRST,
    LANES,
    MARKERS,
    MIN_CLIPS_HEIGHT,
    MIN_TRACK_HEIGHT,
    OBJECTS,
    ORDER,
    OVERVIEW,
    QUALITY,
    RULER,
    SEAMS,
    TAKE,
    VOLUMES,
    arrange_rows,
)


@given(
    height=st.floats(MIN_TRACK_HEIGHT, 600.0),
    folded=st.sets(st.sampled_from(LANES)),
    is_zoomed=st.booleans(),
    n_objects=st.integers(0, 9),
)
def test_rows_lie_below_each_other_inside_the_height(height, folded, is_zoomed, n_objects):
    rows = arrange_rows(height, folded, is_zoomed=is_zoomed, n_objects=n_objects)
    names = [row.name for row in rows]
    assert names == [name for name in ORDER if name in names]
    assert {RULER, CLIPS} <= {*names}
    assert not folded & {*names}
    assert is_zoomed or OVERVIEW not in names
    assert n_objects or OBJECTS not in names
    top = 0.0
    for row in rows:
        assert row.top >= top - 1e-6
        assert row.height >= (MIN_CLIPS_HEIGHT if row.name == CLIPS else HEIGHTS[row.name])
        top = row.top + row.height
    assert top <= height + 1e-6


def test_rows_give_way_one_after_the_other():
    seen = []
    for height in range(300, int(MIN_TRACK_HEIGHT), -1):
        names = tuple(row.name for row in arrange_rows(height, (), is_zoomed=True, n_objects=1))
        if not seen or seen[-1] != names:
            seen.append(names)
    gone = [({*before} - {*after}).pop() for before, after in itertools.pairwise(seen)]
    assert gone == [*reversed(KEPT_FIRST)]
    assert gone == [QUALITY, MARKERS, CACHE, TAKE, VOLUMES, CAMERA, OBJECTS, SEAMS, OVERVIEW]


def test_what_is_left_over_makes_clips_and_quality_larger():
    heights = {row.name: row.height for row in arrange_rows(400, (), is_zoomed=False)}
    assert heights[CLIPS] > HEIGHTS[CLIPS]
    assert heights[QUALITY] > HEIGHTS[QUALITY]
    assert heights[SEAMS] == HEIGHTS[SEAMS]
