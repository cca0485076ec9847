"""Clip arithmetic at every border."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from engine.capture.clip import ClipSpans, cut_clips, split_clips


@given(n_frames=st.integers(1, 500), clip_length=st.integers(1, 60))
def test_clips_cover_every_frame_once_in_order(n_frames: int, clip_length: int) -> None:
    clips = split_clips(n_frames, clip_length)
    assert [frame for clip in clips for frame in clip.frame_indices()] == list(range(n_frames))
    assert [clip.clip_index for clip in clips] == list(range(len(clips)))
    assert all(clip.n_frames == clip_length for clip in clips[:-1])
    assert 1 <= clips[-1].n_frames <= clip_length
    assert clips[-1].stop == n_frames


@given(n_frames=st.integers(1, 200), clip_length=st.integers(1, 40))
def test_clip_time_starts_at_zero_steps_evenly_and_stays_below_one(n_frames: int, clip_length: int) -> None:
    for clip in split_clips(n_frames, clip_length):
        times = [clip.clip_time(frame) for frame in clip.frame_indices()]
        assert times == [i / clip_length for i in range(clip.n_frames)]
        assert 0.0 <= times[-1] < 1.0
        for outside in (clip.start - 1, clip.stop):
            with pytest.raises(ValueError, match="outside clip"):
                clip.clip_time(outside)


@pytest.mark.parametrize(("n_frames", "clip_length"), [(0, 10), (10, 0), (-1, 3)])
def test_no_frames_or_no_length_is_refused(n_frames: int, clip_length: int) -> None:
    with pytest.raises(ValueError, match="at least 1"):
        split_clips(n_frames, clip_length)


def test_clips_of_any_lengths_are_found_by_their_frames() -> None:
    clips = cut_clips((0, 4, 5, 25, 30), 10)
    assert [(clip.start, clip.stop, clip.clip_length) for clip in clips] == [
        (0, 4, 10),
        (4, 5, 10),
        (5, 25, 20),
        (25, 30, 10),
    ]
    spans = ClipSpans(clips)
    for frame in range(30):
        assert clips[spans.index_of(frame)].start <= frame < clips[spans.index_of(frame)].stop
    assert (spans.index_of(-5), spans.index_of(99), spans.usual_length) == (0, 3, 5)
