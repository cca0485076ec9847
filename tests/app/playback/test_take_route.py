"""Playing a take: the playhead goes where the take goes, with loops, in and out points, J, K and L."""

from __future__ import annotations

from app.playback.timeline import Timeline
from engine.capture.clip import split_clips
from engine.timing.segment import Segment
from engine.timing.timing import TakeTiming

TAKE = (Segment(6, 9, is_reversed=True), Segment(2, 3, n_frozen=3), Segment(0, 3))
SHOWN = [8, 7, 6, 2, 2, 2, 0, 1, 2]


def playing(*, is_looping: bool = True) -> Timeline:
    timeline = Timeline(split_clips(10, 5), fps=10.0)
    timeline.timing, timeline.is_take, timeline.is_looping = TakeTiming(TAKE, 10), True, is_looping
    timeline.seek(8)
    return timeline


def visited(timeline: Timeline, n: int) -> list[int]:
    found = []
    for _ in range(n):
        found.append(timeline.frame_index)
        timeline.tick(0.1)
    return found


def test_it_goes_round_and_round_or_to_its_end() -> None:
    timeline = playing()
    timeline.toggle_play()
    assert visited(timeline, 18) == SHOWN * 2
    timeline = playing(is_looping=False)
    timeline.toggle_play()
    assert visited(timeline, 12) == [*SHOWN, 2, 2, 2]
    assert not timeline.is_playing
    timeline.toggle_play()
    assert visited(timeline, 9) == SHOWN


def test_backward_faster_and_from_in_to_out() -> None:
    timeline = playing()
    timeline.shuttle(-1)
    assert visited(timeline, 9) == [8, *SHOWN[:0:-1]]
    timeline = playing()
    timeline.speed = 2.0
    timeline.toggle_play()
    assert visited(timeline, 5) == SHOWN[::2]
    timeline = playing()
    timeline.set_range(0, 5)
    timeline.toggle_play()
    assert visited(timeline, 12) == SHOWN[3:] * 2
    timeline.set_range(9, 9)  # nothing of the take is there: the capture is played
    assert timeline.route is None


def test_the_playhead_stays_one_of_the_capture() -> None:
    timeline = playing()
    timeline.toggle_play()
    timeline.tick(0.1)
    timeline.seek(1)
    assert visited(timeline, 3) == [1, 2, 8]
    timeline.seek(5)  # not in the take: its nearest place
    timeline.tick(0.1)
    assert timeline.frame_index in SHOWN
    timeline.is_take = False
    timeline.seek(3)
    assert visited(timeline, 3) == [3, 4, 5]
    other = Timeline(split_clips(10, 2), fps=10.0)
    other.take_over(timeline)
    assert other.timing == timeline.timing
