"""Markers are found by frame, in whatever order they come."""

from hypothesis import given
from hypothesis import strategies as st

from app.document.project_document import Marker
from app.playback.markers import Markers

FRAMES = st.integers(0, 40)


@given(st.lists(FRAMES, max_size=20, unique=True), FRAMES)
def test_markers_say_the_same_as_a_set_of_frames(put, frame_index):
    markers = Markers([Marker(frame, f"at {frame}") for frame in put])
    assert markers.frames == sorted(put)
    assert (len(markers), bool(markers)) == (len(put), bool(put))
    before = [frame for frame in put if frame < frame_index]
    after = [frame for frame in put if frame > frame_index]
    found_before, found_after = markers.before(frame_index), markers.after(frame_index)
    assert (None if found_before is None else found_before.frame_index) == (max(before) if before else None)
    assert (None if found_after is None else found_after.frame_index) == (min(after) if after else None)
    found = markers.at(frame_index)
    assert (None if found is None else found.text) == (f"at {frame_index}" if frame_index in put else None)
    between = [marker.frame_index for marker in markers.between(5, 20)]
    assert between == sorted(frame for frame in put if 5 <= frame < 20)
