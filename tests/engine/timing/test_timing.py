"""The timing of a take against a slow truth: the speed curve added up in small steps, one segment at a time."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import structs

from engine.errors import ProjectError
from engine.timing.cutting import at_speed, cut_at, frozen, kept, looped, turned
from engine.timing.segment import MAX_SPEED, MIN_SPEED, Segment
from engine.timing.timing import SourceMoment, TakeTiming, check_length, nearest_frames

N_FRAMES = 40
STEPS_PER_FRAME = 500


def slow_speed(one: Segment, share: float) -> float:
    """The speed after a share of the time of a pass, by the words of Segment."""
    x = one.ramp_from + (one.ramp_to - one.ramp_from) * share
    return one.start_speed + (one.end_speed - one.start_speed) * (x if one.ease == "linear" else 3 * x**2 - 2 * x**3)


def slow_advance(one: Segment, time: float) -> float:
    """Frames of the capture played after some output frames: the curve of speeds added up in float64."""
    n = max(int(one.pass_frames * STEPS_PER_FRAME), 2000)
    shares = (np.arange(n) + 0.5) / n
    speeds = np.array([slow_speed(one, share) for share in shares])
    length = one.n_source / speeds.mean()
    return float(np.interp(time / length, np.arange(n + 1) / n, np.concatenate([[0], np.cumsum(speeds)]) * length / n))


@st.composite
def segments(draw: st.DrawFn, n_frames: int = N_FRAMES) -> Segment:
    first = draw(st.integers(0, n_frames - 1))
    stop = draw(st.integers(first + 1, n_frames))
    if draw(st.integers(0, 5)) == 0:
        return Segment(first, first + 1, n_frozen=draw(st.integers(1, 20)))
    speeds = st.sampled_from((0.1, 0.25, 0.3, 1.0, 1.7, 10.0))
    start, end = draw(speeds), draw(speeds)
    low, high = draw(st.sampled_from(((0.0, 1.0), (0.0, 0.3), (0.4, 1.0))))
    one = Segment(
        first,
        stop,
        start,
        end,
        draw(st.sampled_from(("linear", "smooth"))),
        low,
        high,
        is_reversed=draw(st.booleans()),
        repeats=draw(st.integers(1, 4)),
    )
    most = math.floor(one.pass_frames / 2) if one.repeats > 1 else 0
    return structs.replace(one, crossfade_frames=draw(st.integers(0, most)))


takes = st.lists(segments(), min_size=1, max_size=5).map(tuple)


@settings(max_examples=60, deadline=None)
@given(segments())
def test_a_pass_goes_as_far_as_its_speeds_add_up(one: Segment) -> None:
    if one.n_frozen:
        assert float(one.advance(np.array(3.0))) == 0.0
        return
    for share in (0.0, 0.2, 0.5, 0.9, 1.0):
        time = share * one.pass_frames
        found = float(one.advance(np.array(time)))
        assert found == pytest.approx(slow_advance(one, time), abs=1e-4 * one.n_source)
        assert one.time_at(found) == pytest.approx(time, abs=1e-6 * one.pass_frames)
    assert float(one.advance(np.array(one.pass_frames))) == pytest.approx(one.n_source)


@settings(max_examples=80, deadline=None)
@given(takes)
def test_what_is_seen_lies_in_the_segment_and_its_weights_add_up_to_1(take: tuple[Segment, ...]) -> None:
    timing = TakeTiming(take, N_FRAMES)
    outputs = np.arange(timing.n_output)
    frames, weights = timing.moments(outputs)
    np.testing.assert_allclose(weights.sum(axis=0), 1.0)
    assert (weights >= 0).all()
    for output in outputs.tolist():
        place = int(np.searchsorted(timing.starts[:-1], output + 1e-6, side="right")) - 1
        one = take[place]
        goes_on = place + 1 < len(take) and one.leads_to(take[place + 1])
        low, high = (one.first - goes_on, one.stop - 1 + goes_on) if one.is_reversed else (one.first, one.stop - 1)
        high += goes_on and not one.is_reversed
        seen = frames[:, output][weights[:, output] > 0]
        assert (seen >= max(low, 0) - 1e-6).all()
        assert (seen <= min(high, N_FRAMES - 1) + 1e-6).all()
        assert timing.source_at(output) == tuple(
            SourceMoment(frame, weight)
            for frame, weight in zip(frames[:, output].tolist(), weights[:, output].tolist(), strict=True)
            if weight > 0
        )
    shown = nearest_frames(timing)
    assert len(shown) == timing.n_output
    assert ((shown >= 0) & (shown < N_FRAMES)).all()


@settings(max_examples=60, deadline=None)
@given(segments())
def test_time_goes_one_way_within_a_pass(one: Segment) -> None:
    timing = TakeTiming((structs.replace(one, repeats=1, crossfade_frames=0),), N_FRAMES)
    steps = np.diff(timing.moments(np.arange(0, timing.n_output, 0.25))[0][0])
    assert (steps <= 1e-9).all() if one.is_reversed or one.n_frozen else (steps >= -1e-9).all()


@settings(max_examples=60, deadline=None)
@given(takes, st.integers(0, N_FRAMES - 1))
def test_a_frame_is_found_where_the_take_shows_it(take: tuple[Segment, ...], frame: int) -> None:
    timing = TakeTiming(take, N_FRAMES)
    for output in timing.outputs_of(frame):
        if output <= timing.n_output - 1:
            assert min(abs(one.frame - frame) for one in timing.source_at(output + 1e-7)) < 1e-3


@settings(max_examples=80, deadline=None)
@given(takes, st.integers(1, N_FRAMES - 1))
def test_a_split_changes_nothing_of_what_plays(take: tuple[Segment, ...], frame: int) -> None:
    try:
        after = cut_at(take, frame)
    except ProjectError:
        assert any(one.repeats > 1 and one.first < frame < one.stop for one in take)
        return
    one, other = TakeTiming(take, N_FRAMES), TakeTiming(after, N_FRAMES)
    assert other.n_output == one.n_output
    outputs = np.arange(one.n_output - 1) + 0.013  # not where one ends and the next begins
    np.testing.assert_allclose(other.moments(outputs)[0], one.moments(outputs)[0], atol=1e-6)


@settings(max_examples=60, deadline=None)
@given(takes, st.integers(0, N_FRAMES - 1), st.integers(1, N_FRAMES))
def test_reversed_twice_plays_as_before(take: tuple[Segment, ...], first: int, length: int) -> None:
    span = (first, min(first + length, N_FRAMES))
    try:
        once = turned(take, span)
    except ProjectError:
        return
    whole = turned(once, span)
    assert TakeTiming(once, N_FRAMES).n_output == TakeTiming(take, N_FRAMES).n_output
    cut = cut_at(cut_at(take, span[0]), span[1])
    assert len(whole) == len(cut)
    for one, other in zip(whole, cut, strict=True):
        assert (one.first, one.stop, one.is_reversed) == (other.first, other.stop, other.is_reversed)
        assert one.pass_frames == pytest.approx(other.pass_frames)


def frames_of(take: tuple[Segment, ...]) -> list[float]:
    """What is seen first of each output frame."""
    timing = TakeTiming(take, N_FRAMES)
    return [timing.source_at(output)[0].frame for output in range(timing.n_output)]


WHOLE = (Segment(0, N_FRAMES),)


def test_no_segments_are_the_capture() -> None:
    timing = TakeTiming((), 5)
    assert timing.is_as_captured
    assert [timing.source_at(output) for output in range(timing.n_output)] == [(SourceMoment(k),) for k in range(5)]
    assert TakeTiming(cut_at((Segment(0, 5),), 2), 5).is_as_captured
    assert not TakeTiming((Segment(2, 5), Segment(0, 2)), 5).is_as_captured
    assert not TakeTiming((Segment(0, 4),), 5).is_as_captured
    assert timing.duration_s(25.0) == 0.2


def test_takes_play_what_they_say() -> None:
    assert frames_of(kept(WHOLE, (10, 13))) == [10, 11, 12]
    assert frames_of(turned(kept(WHOLE, (10, 13)), (0, 40))) == [12, 11, 10]
    assert frames_of(at_speed(kept(WHOLE, (10, 14)), (0, 40), 2.0, 2.0, "linear")) == [10, 12]
    assert frames_of(at_speed(kept(WHOLE, (10, 12)), (0, 40), 0.5, 0.5, "linear")) == [10, 10.5, 11, 11]
    slow = at_speed(kept(WHOLE, (10, 13)), (10, 11), 0.5, 0.5, "linear")
    assert frames_of(slow) == [10, 10.5, 11, 12]  # goes on into the next segment
    assert frames_of(frozen(kept(WHOLE, (10, 13)), 11, 3)) == [10, 11, 11, 11, 12]
    assert frames_of(looped(kept(WHOLE, (10, 13)), (10, 12), 3, 0)) == [10, 11, 10, 11, 10, 11, 12]


def test_a_loop_fades_its_end_into_its_beginning() -> None:
    timing = TakeTiming(looped((Segment(0, 4),), (0, 4), 2, 1), 40)
    assert timing.n_output == 7
    assert timing.source_at(3) == (SourceMoment(0.0, 0.5), SourceMoment(3.0, 0.5))
    assert [timing.source_at(output)[0].frame for output in range(7)] == [0, 1, 2, 0, 1, 2, 3]
    backward = TakeTiming(looped(turned((Segment(0, 4),), (0, 4)), (0, 4), 2, 2), 40)
    assert [one.frame for one in backward.source_at(2)] == [3, 1]
    assert sum(one.weight for one in backward.source_at(2)) == pytest.approx(1.0)


def test_very_short_and_very_fast_segments() -> None:
    one = TakeTiming((Segment(7, 8, 10.0, 10.0),), 40)
    assert (one.n_output, one.source_at(0)) == (1, (SourceMoment(7.0),))
    slow = TakeTiming((Segment(7, 8, 0.1, 0.1),), 40)
    assert slow.n_output == 10
    assert {moment.frame for output in range(10) for moment in slow.source_at(output)} == {7.0}
    fast = TakeTiming((Segment(0, 40, 10.0, 10.0),), 40)
    assert [fast.source_at(output)[0].frame for output in range(fast.n_output)] == [0, 10, 20, 30]


def test_the_capture_may_be_shorter_than_the_take() -> None:
    timing = TakeTiming((Segment(0, 30, repeats=2, crossfade_frames=14), Segment(30, 40)), 10)
    assert [one.stop for one in timing.played] == [10]
    assert timing.n_output == 15
    assert TakeTiming((Segment(30, 40),), 10).is_as_captured


@pytest.mark.parametrize(
    "entries",
    [
        *({"first": 3, "stop": 3}, {"first": -1}, {"start_speed": 0.0}, {"end_speed": MAX_SPEED * 1.01}),
        *({"start_speed": MIN_SPEED / 2}, {"start_speed": math.nan}, {"ramp_from": 0.5, "ramp_to": 0.5}),
        *({"n_frozen": 3}, {"first": 3, "stop": 4, "n_frozen": -1}, {"repeats": 0}, {"crossfade_frames": 1}),
        *({"repeats": 2, "crossfade_frames": 6}, {"repeats": 10**9}, {"first": 1, "stop": 2, "n_frozen": 10**9}),
    ],
)
def test_what_cannot_be_a_segment_is_refused(entries: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"\d|nan|frozen"):
        Segment(**{"first": 0, "stop": 10, **entries})


def test_what_cannot_be_done_is_refused() -> None:
    loop = looped(WHOLE, (10, 20), 2, 0)
    for refused in (
        lambda: cut_at(loop, 15),
        lambda: kept(kept(WHOLE, (0, 5)), (10, 20)),
        lambda: frozen(loop, 12, 5),
        lambda: looped(at_speed(WHOLE, (0, 20), 0.5, 0.5, "linear"), (10, 30), 2, 0),
        lambda: looped(frozen(WHOLE, 5, 9), (5, 6), 2, 0),
    ):
        with pytest.raises(ProjectError) as error:
            refused()
        assert error.value.hint
    with pytest.raises(ValueError, match="1,000,000"):
        check_length((Segment(0, 2**31 - 1),))
    with pytest.raises(ValueError, match="1000"):
        check_length(WHOLE * 1001)


def test_a_ramp_over_several_segments_is_one_ramp() -> None:
    found = at_speed(cut_at(WHOLE, 20), (10, 30), 0.5, 2.0, "smooth")
    assert found == (Segment(0, 10), Segment(10, 30, 0.5, 2.0, "smooth"), Segment(30, 40))
