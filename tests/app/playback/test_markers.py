"""Markers stay in order, one a frame, and are found again."""

from hypothesis import given
from hypothesis import strategies as st

from app.playback.markers import MAX_MARKERS, MAX_NAME_CHARACTERS, Marker, Markers

FRAMES = st.integers(0, 40)


def filled(frames: list[int]) -> Markers:
    markers = Markers()
    for frame_index in frames:
        markers.put(frame_index, f"at {frame_index}")
    return markers


@given(st.lists(FRAMES, max_size=20), st.lists(FRAMES, max_size=8), FRAMES)
def test_markers_say_the_same_as_a_set_of_frames(put, removed, frame_index):
    markers = filled(put)
    for frame in removed:
        markers.remove(frame)
    left = sorted({*put} - {*removed})
    assert markers.frames == left
    assert len(markers) == len(left)
    before = [frame for frame in left if frame < frame_index]
    after = [frame for frame in left if frame > frame_index]
    found_before, found_after = markers.before(frame_index), markers.after(frame_index)
    assert (None if found_before is None else found_before.frame_index) == (before[-1] if before else None)
    assert (None if found_after is None else found_after.frame_index) == (after[0] if after else None)
    assert (markers.at(frame_index) is not None) == (frame_index in left)
    assert [marker.frame_index for marker in markers.between(5, 20)] == [frame for frame in left if 5 <= frame < 20]


def test_a_second_marker_on_a_frame_is_another_name():
    markers = filled([3])
    assert markers.put(3, "50 % ## of\nall")
    assert [*markers] == [Marker(3, "50 % ## of\nall")]


def test_too_long_a_name_is_cut_and_too_many_markers_are_refused():
    markers = filled([*range(MAX_MARKERS)])
    assert not markers.put(MAX_MARKERS, "one more")
    assert markers.put(7, "x" * 500), "an old one still takes another name"
    renamed = markers.at(7)
    assert renamed is not None
    assert len(renamed.name) == MAX_NAME_CHARACTERS
    markers.keep_below(10)
    assert markers.frames == [*range(10)]
