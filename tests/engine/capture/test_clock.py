"""The common clock: which frames belong together when cameras differ in rate, length, start and evenness."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from engine.capture.frames import IndexedFrames
from engine.capture.times.clock import common_clock
from engine.errors import CaptureError

EVEN = np.arange(100) / 30


def test_cameras_in_step_keep_their_frames():
    clock = common_clock([EVEN, EVEN + 5, EVEN], offsets_s=[0, 5, 0])
    assert clock.is_as_recorded
    assert clock.is_even
    assert clock.fps == 30
    assert clock.errors_s.max() < 1e-9
    assert "paired by index" in clock.note()


def test_whole_offsets_and_unequal_lengths_leave_what_all_cameras_show():
    clock = common_clock([EVEN, EVEN[:90], EVEN], offsets_s=[0, 3 / 30, -5 / 30])
    assert clock.n_frames == 82
    np.testing.assert_array_equal(clock.frame_indices[:, 0], [5, 8, 0])
    np.testing.assert_array_equal(clock.frame_indices[:, -1], [86, 89, 81])
    assert clock.errors_s.max() < 1e-9


def test_parts_of_a_frame_are_rounded_and_stated():
    clock = common_clock([EVEN, EVEN], offsets_s=[0, 2.4 / 30])
    np.testing.assert_array_equal(clock.frame_indices[1] - clock.frame_indices[0], 2)
    np.testing.assert_allclose(clock.errors_s.sum(axis=0), 0.4 / 30, atol=1e-9)
    assert "6.7 ms" in clock.note()


def test_the_slowest_camera_sets_the_rate():
    clock = common_clock([EVEN, np.arange(240) / 60, np.arange(90) / 25])
    assert clock.fps == 25
    assert clock.errors_s[2].max() < 1e-9
    assert clock.errors_s.max() <= 0.5 / 25 + 1e-9  # one that ends half a moment early still has the last one


def test_rates_that_differ_a_little_drift_apart_without_losing_step():
    ntsc = np.arange(3000) / (30 / 1.001)
    clock = common_clock([np.arange(3000) / 30, ntsc])
    assert clock.errors_s.max() < 0.5 / 29
    assert (np.diff(clock.frame_indices, axis=1) >= 0).all()


def test_uneven_recordings_that_agree_stay_together():
    generator = np.random.default_rng(3)
    taken = np.cumsum(generator.uniform(0.1, 0.25, 50))
    cameras = [taken + generator.normal(0, 0.002, 50) for _ in range(4)]
    clock = common_clock(cameras)
    assert clock.is_as_recorded
    assert not clock.is_even
    assert clock.errors_s.max() < 0.01


def test_a_camera_that_lost_frames_repeats_its_nearest_one():
    clock = common_clock([EVEN, EVEN, np.delete(EVEN, [10, 11, 50])])
    assert clock.n_frames == 100
    assert clock.errors_s[:2].max() < 1e-9
    np.testing.assert_array_equal(clock.frame_indices[2, 12:50], np.arange(10, 48))
    assert "repeats" in clock.note()


def test_times_rounded_to_milliseconds_give_a_tidy_rate():
    assert common_clock([np.round(EVEN, 3)] * 2).fps == 30


def test_a_rate_may_be_asked_for():
    clock = common_clock([EVEN, EVEN], fps=15)
    assert clock.n_frames == 50
    np.testing.assert_array_equal(clock.frame_indices[0], np.arange(0, 100, 2))
    assert common_clock([EVEN, EVEN], fps=30).is_as_recorded
    assert common_clock([EVEN, EVEN], fps=0.1).n_frames >= 1


def test_single_frames_are_a_moment():
    assert common_clock([np.zeros(1), np.zeros(1)]).n_frames == 1


def test_a_slow_camera_without_a_frame_in_the_shared_time():
    clock = common_clock([np.array([0.0, 10.0]), np.arange(5.0, 5.2, 1 / 30)])
    assert clock.n_frames >= 1
    assert clock.frame_indices.shape == (2, clock.n_frames)


@pytest.mark.parametrize(
    ("times", "reason"),
    [
        ([EVEN, np.zeros(0)], "no times"),
        ([EVEN, np.array([0, np.nan, 1])], "frame 1"),
        ([EVEN, np.array([0, 0.1, 0.1])], "not later"),
        ([EVEN, EVEN + 60], "No moment"),
    ],
)
def test_unusable_times_are_refused(times, reason):
    with pytest.raises(CaptureError, match=reason):
        common_clock(times, names=["a", "b"])


def test_an_impossible_rate_is_refused():
    with pytest.raises(CaptureError, match="frames per second"):
        common_clock([EVEN], fps=float("nan"))


class _Numbered:
    """A source whose pictures are their own numbers."""

    path = Path("numbered")
    n_frames = 100

    def read(self, frame_indices: Sequence[int]) -> Iterator[np.ndarray]:
        for frame_index in frame_indices:
            yield np.full((2, 2, 3), frame_index, dtype=np.uint8)

    def close(self) -> None:
        """Nothing is open."""


def test_pictures_are_read_through_the_clock():
    clock = common_clock([EVEN, EVEN], offsets_s=[0, 7 / 30])
    source = clock.source(1, _Numbered())
    assert isinstance(source, IndexedFrames)
    assert source.n_frames == 93
    assert [int(frame[0, 0, 0]) for frame in source.read([0, 3, 1])] == [7, 10, 8]


def test_a_source_in_step_is_left_alone():
    source = _Numbered()
    assert common_clock([EVEN, EVEN]).source(0, source) is source
