"""Cutting: segments of a take split, kept, turned round, slowed down, held and looped by frames of the capture.

Functions from segments to segments. Frames that come several times in the take are changed wherever they come.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from msgspec import structs

from engine.errors import ProjectError
from engine.timing.segment import Ease, Segment

Segments = tuple[Segment, ...]
Span = tuple[int, int]
"""First frame of the capture, and the one after the last."""


def cut_at(segments: Segments, frame: int) -> Segments:
    """Split whatever plays across the beginning of a frame. What plays does not change.

    Raises:
        ProjectError: A loop does.
    """
    found: list[Segment] = []
    for one in segments:
        found += _split(one, frame) if one.first < frame < one.stop else [one]
    return tuple(found)


def _split(one: Segment, frame: int) -> list[Segment]:
    if not one.is_simple:
        raise ProjectError(
            f"Frames {one.first} to {one.stop - 1} are a loop, which cannot be split at frame {frame}.",
            hint="Take the whole loop, or end it first: loop it once.",
        )
    share = one.time_at(one.stop - frame if one.is_reversed else frame - one.first) / one.pass_frames
    if one.ease == "linear" or one.start_speed == one.end_speed:
        start, middle, end = (one.speed_at(part) for part in (0.0, share, 1.0))
        one = structs.replace(one, ramp_from=0.0, ramp_to=1.0)
        before = structs.replace(one, start_speed=start, end_speed=middle)
        after = structs.replace(one, start_speed=middle, end_speed=end)
    else:
        middle = one.ramp_from + (one.ramp_to - one.ramp_from) * share
        before, after = structs.replace(one, ramp_to=middle), structs.replace(one, ramp_from=middle)
    if one.is_reversed:
        return [structs.replace(before, first=frame), structs.replace(after, stop=frame)]
    return [structs.replace(before, stop=frame), structs.replace(after, first=frame)]


def kept(segments: Segments, span: Span) -> Segments:
    """Only frames of a span. Raises ProjectError where none is left."""
    found = tuple(one for one in _cut(segments, span) if _is_in(one, span))
    if not found:
        raise _not_played(span)
    return found


def turned(segments: Segments, span: Span) -> Segments:
    """Frames of a span played the other way round, each as fast as before."""
    return _with_runs(segments, span, lambda run: [turned_segment(one) for one in reversed(run)])


def turned_segment(one: Segment) -> Segment:
    """One segment the other way round; its frames are as fast as before."""
    return structs.replace(
        one,
        start_speed=one.end_speed,
        end_speed=one.start_speed,
        ramp_from=1.0 - one.ramp_to,
        ramp_to=1.0 - one.ramp_from,
        is_reversed=not one.is_reversed and not one.n_frozen,
    )


def at_speed(segments: Segments, span: Span, start: float, end: float, ease: Ease) -> Segments:
    """Frames of a span at another speed, from the first to the last of those that play on. What is frozen stays so."""

    def change(run: Sequence[Segment]) -> list[Segment]:
        parts = [[one] for one in run] if start == end else _joined(run)
        return [
            structs.replace(
                part[0],
                first=min(one.first for one in part),
                stop=max(one.stop for one in part),
                start_speed=start,
                end_speed=end,
                ease=ease,
                ramp_from=0.0,
                ramp_to=1.0,
            )
            if not part[0].n_frozen
            else part[0]
            for part in parts
        ]

    return _with_runs(segments, span, change)


def frozen(segments: Segments, frame: int, n_frozen: int) -> Segments:
    """A frame held for so many output frames in place of its own time."""

    def hold(run: Sequence[Segment]) -> list[Segment]:
        return [Segment(frame, frame + 1, n_frozen=n_frozen) for _ in run]

    return _with_runs(segments, (frame, frame + 1), hold)


def looped(segments: Segments, span: Span, repeats: int, crossfade_frames: int) -> Segments:
    """Frames of a span played several times; once ends a loop.

    Raises:
        ProjectError: They do not play on at one speed.
    """

    def repeat(run: Sequence[Segment]) -> list[Segment]:
        parts = _joined(run)
        for part in parts:
            speeds = {(one.start_speed, one.end_speed) for one in part}
            if part[0].n_frozen or (len(part) > 1 and len(speeds) > 1):
                raise ProjectError(
                    f"Frames {span[0]} to {span[1] - 1} do not play at one speed, so that they cannot be looped at "
                    "once.",
                    hint="Loop one segment, or give all of these frames one speed first.",
                )
        return [
            structs.replace(
                part[0],
                first=min(one.first for one in part),
                stop=max(one.stop for one in part),
                repeats=repeats,
                crossfade_frames=crossfade_frames,
            )
            for part in parts
        ]

    return _with_runs(segments, span, repeat)


def _joined(run: Sequence[Segment]) -> list[list[Segment]]:
    """Parts of a run that play on without a jump."""
    parts: list[list[Segment]] = []
    for one in run:
        last = parts[-1][-1] if parts else None
        if last and last.is_simple and one.is_simple and last.leads_to(one):
            parts[-1].append(one)
        else:
            parts.append([one])
    return parts


def _with_runs(segments: Segments, span: Span, change: Callable[[Sequence[Segment]], list[Segment]]) -> Segments:
    """Every run of neighbouring segments in a span changed. Raises ProjectError where there is none."""
    found: list[Segment] = []
    run: list[Segment] = []
    n_runs = 0
    for one in (*_cut(segments, span), None):
        if one is not None and _is_in(one, span):
            run.append(one)
            continue
        if run:
            found += change(run)
            n_runs += 1
            run = []
        if one is not None:
            found.append(one)
    if not n_runs:
        raise _not_played(span)
    return tuple(found)


def _cut(segments: Segments, span: Span) -> Segments:
    return cut_at(cut_at(segments, span[0]), span[1])


def _is_in(one: Segment, span: Span) -> bool:
    return span[0] <= one.first and one.stop <= span[1]


def _not_played(span: Span) -> ProjectError:
    frames = f"Frame {span[0]} is" if span[1] == span[0] + 1 else f"Frames {span[0]} to {span[1] - 1} are"
    return ProjectError(f"{frames} not in the take.", hint="Choose frames that are played, or reset the timing.")
