"""The change of time that makes some segments of others, found again from what it did."""

from __future__ import annotations

from collections.abc import Callable

from app.document.changes.timing_changes import (
    ChangeSpeed,
    Freeze,
    Loop,
    Order,
    ResetTime,
    Reverse,
    Split,
    TimeEdit,
    Trim,
)
from engine.errors import ProjectError
from engine.timing.cutting import Segments
from engine.timing.segment import Segment


def time_edit_between(before: Segments, after: Segments, n_frames: int) -> TimeEdit | None:
    """The change that makes some segments of others; None where it takes more than one, or only the window can.

    Args:
        before, after: As in documents: none for the take as captured.
    """
    whole = (Segment(0, n_frames),)
    before, after = before or whole, after or whole
    if after == whole:
        return ResetTime()
    places = {one: place for place, one in enumerate(before)}
    found: list[Callable[[], TimeEdit]] = []
    if all(one in places for one in after):
        found.append(lambda: Order(tuple(places[one] for one in after)))
    bounds = sorted({bound for one in after for bound in (one.first, one.stop)})
    found.append(lambda: Trim((bounds[0], bounds[-1])))
    found += [lambda at=bound: Split(at) for bound in bounds]
    new = [one for one in after if one not in places]
    for one in new:
        span = (one.first, one.stop)
        found.append(lambda one=one, span=span: ChangeSpeed(span, one.start_speed, _end_speed(one), one.ease))
        if one.n_frozen:
            found.append(lambda one=one: Freeze(one.first, one.n_frozen))
        found.append(lambda span=span: Reverse(span))
        found.append(lambda one=one, span=span: Loop(span, one.repeats, one.crossfade_frames))
    if new:
        span = (min(one.first for one in new), max(one.stop for one in new))
        found.append(lambda: Reverse(span))
        found.append(lambda: ChangeSpeed(span, new[0].start_speed, _end_speed(new[0]), new[0].ease))
    return next((edit for make in found if (edit := _tried(make, before, after, n_frames)) is not None), None)


def _tried(make: Callable[[], TimeEdit], before: Segments, after: Segments, n_frames: int) -> TimeEdit | None:
    try:
        edit = make()
        return edit if edit.applied(before, n_frames) == after else None
    except (ProjectError, ValueError):
        return None


def _end_speed(one: Segment) -> float | None:
    return None if one.end_speed == one.start_speed else one.end_speed
