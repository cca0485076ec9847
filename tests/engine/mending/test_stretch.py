"""Which frames are mended, and what a result has to be to be kept."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from engine.capture.clip import split_clips
from engine.errors import ProjectError
from engine.mending.figures import StretchFigures
from engine.mending.stretch import boundary_stretch, frames_stretch

CLIPS = split_clips(30, 10)


def test_a_boundary_reaches_some_frames_into_both_clips() -> None:
    stretch = boundary_stretch(CLIPS, 2)
    assert (stretch.first, stretch.stop, stretch.pairs, stretch.clip_indices) == (16, 24, (20,), (1, 2))
    assert stretch.words == "the seam at frame 20"
    assert [list(stretch.frames_in(CLIPS[index])) for index in (1, 2)] == [[16, 17, 18, 19], [20, 21, 22, 23]]


def test_short_clips_keep_frames_for_their_other_boundary() -> None:
    stretch = boundary_stretch(split_clips(6, 2), 1)
    assert (stretch.first, stretch.stop) == (1, 3)


@pytest.mark.parametrize("after", [0, 3, -1])
def test_there_is_no_boundary_before_the_first_clip_or_behind_the_last(after: int) -> None:
    with pytest.raises(ProjectError, match=f"Clip {after} has no boundary"):
        boundary_stretch(CLIPS, after)


def test_frames_may_lie_in_two_clips() -> None:
    stretch = frames_stretch(CLIPS, 8, 13)
    assert (stretch.pairs, stretch.clip_indices) == ((9, 10, 11, 12), (0, 1))
    assert stretch.words == "frames 8 to 12"


@pytest.mark.parametrize(("first", "stop"), [(5, 5), (5, 6), (9, 4), (-1, 4), (20, 31)])
def test_frames_that_are_none_are_refused(first: int, stop: int) -> None:
    with pytest.raises(ProjectError, match="cannot be mended"):
        frames_stretch(CLIPS, first, stop)


def test_frames_of_three_clips_are_refused() -> None:
    with pytest.raises(ProjectError, match="3 clips"):
        frames_stretch(CLIPS, 5, 25)


BEFORE = StretchFigures(excess=0.4, worst=0.5, elsewhere=0.2, psnr={"0": 30.0, "1": 29.0})


@pytest.mark.parametrize(
    ("changes", "is_better"),
    [
        ({"excess": 0.2, "worst": 0.3}, True),
        ({"excess": 0.2, "worst": 0.3, "psnr": {"0": 30.0, "1": 28.96}}, True),
        ({"excess": 0.2, "worst": 0.3, "psnr": {"0": 30.0, "1": 28.94}}, False),  # bought with quality
        ({"excess": 0.2, "worst": 0.6}, False),  # the jump is one frame further now
        ({"excess": 0.2, "worst": 0.3, "elsewhere": 0.3}, False),  # flickers elsewhere now
        ({"excess": 0.395, "worst": 0.3}, False),  # as good as nothing
        ({"excess": None, "worst": None}, False),
    ],
)
def test_an_attempt_is_kept_where_it_helps_and_costs_nothing(changes: dict, is_better: bool) -> None:
    assert replace(BEFORE, **changes).is_better_than(BEFORE, BEFORE) == is_better


def test_half_is_enough() -> None:
    assert not replace(BEFORE, excess=0.21).is_enough(BEFORE)
    assert replace(BEFORE, excess=0.2).is_enough(BEFORE)


def test_what_is_lost_is_counted_from_the_beginning() -> None:
    first = replace(BEFORE, excess=0.3, psnr={"0": 30.0, "1": 28.96})
    second = replace(BEFORE, excess=0.2, psnr={"0": 30.0, "1": 28.92})
    assert not second.is_better_than(first, BEFORE)
