"""Actions on when the take plays what: at the playhead, from in to out, or on the chosen segment."""

from __future__ import annotations

from collections.abc import Callable

from app.document.changes.timing_changes import (
    ChangeSegment,
    ChangeSpeed,
    Freeze,
    Loop,
    ResetTime,
    Reverse,
    Split,
    TimeEdit,
    Trim,
)
from app.session.session_view import SessionView
from engine.timing.cutting import Span, turned_segment
from engine.timing.segment import MAX_SPEED, MIN_SPEED, Segment
from ui.panels.actions.action import TAKE, Action, Run
from ui.panels.editing.panel.timing import changed_segment
from ui.panels.state import Dispatch, UiState

SPEED_STEP = 2.0
FROZEN_S = 1.0
"""For so long a frame is frozen at first."""
LOOPS = 3


def _chosen(session: SessionView, ui: UiState) -> tuple[int, Segment] | None:
    """The chosen segment and its number; the only one where there is one."""
    segments, place = session.edits.timing, ui.timeline.segment
    return None if place is None or place >= len(segments) else (place, segments[place])


def _range(session: SessionView) -> Span | None:
    """From the in to the out point; None for the whole capture."""
    timeline = session.timeline
    if timeline.in_frame is None and timeline.out_frame is None:
        return None
    last = timeline.last_frame if timeline.out_frame is None else timeline.out_frame
    return timeline.in_frame or 0, last + 1


def _cannot(session: SessionView) -> str:
    return "" if session.edits.can_edit else session.edits.why_not or "The take cannot be changed now."


def _no_range(session: SessionView) -> str:
    return _cannot(session) or ("" if _range(session) else "Set the in and out points first (I and O).")


def _no_timing(session: SessionView) -> str:
    return "" if session.edits.timing else "The take plays as captured."


def _sending(make: Callable[[SessionView], TimeEdit]) -> Run:
    def run(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        dispatch(make(session))

    return run


def _reverse(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    chosen = _chosen(session, ui)
    if chosen is not None and not chosen[1].n_frozen:
        dispatch(ChangeSegment(chosen[0], turned_segment(chosen[1])))
    else:
        dispatch(Reverse(_range(session)))


def _loop(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Loops, or ends the loop that is chosen."""
    chosen = _chosen(session, ui)
    if chosen is None or chosen[1].n_frozen:
        dispatch(Loop(_range(session), LOOPS))
        return
    place, one = chosen
    looped = changed_segment(one, repeats=1 if one.repeats > 1 else LOOPS)
    if looped is not None:
        dispatch(ChangeSegment(place, looped))


def _speed_of(session: SessionView) -> float:
    """The speed at the in point, or at the beginning of the take."""
    first = (_range(session) or (0, 0))[0]
    segments = session.edits.timing
    found = (one.start_speed for one in segments if one.first <= first < one.stop and not one.n_frozen)
    return next(found, segments[0].start_speed if segments else 1.0)


def _speed_by(factor: float) -> Run:
    def change(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        chosen = _chosen(session, ui)
        if chosen is None:
            speed = _speed_of(session) * factor
            dispatch(ChangeSpeed(_range(session), min(max(speed, MIN_SPEED), MAX_SPEED)))
            return
        place, one = chosen
        speeds = {
            name: min(max(speed * factor, MIN_SPEED), MAX_SPEED)
            for name, speed in (("start_speed", one.start_speed), ("end_speed", one.end_speed))
        }
        found = changed_segment(one, **speeds)
        if found is not None and found != one:
            dispatch(ChangeSegment(place, found))

    return change


def _toggle_take(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    session.timeline.is_take = not session.timeline.is_take


def _freeze(session: SessionView) -> TimeEdit:
    timeline = session.timeline
    return Freeze(timeline.frame_index, max(round(FROZEN_S * timeline.fps), 1))


ACTIONS = (
    Action(
        "take.play",
        "Play the edited take, or the capture",
        TAKE,
        _toggle_take,
        keys=("Alt+P",),
        is_on=lambda session: session.timeline.is_take,
        lacks=_no_timing,
    ),
    Action(
        "take.split",
        "Split the take at the playhead",
        TAKE,
        _sending(lambda session: Split(session.timeline.frame_index)),
        keys=("Shift+K",),
        lacks=_cannot,
    ),
    Action(
        "take.trim",
        "Trim the take to the in and out points",
        TAKE,
        _sending(lambda session: Trim(_range(session) or (0, session.timeline.n_frames))),
        keys=("Shift+O",),
        lacks=_no_range,
    ),
    Action(
        "take.reverse",
        "Reverse the chosen segment, or in to out",
        TAKE,
        _reverse,
        keys=("Shift+J",),
        lacks=_cannot,
    ),
    Action("take.freeze", "Freeze this frame for a second", TAKE, _sending(_freeze), keys=("Alt+J",), lacks=_cannot),
    Action(
        "take.loop",
        "Loop the chosen segment, or in to out; again: end the loop",
        TAKE,
        _loop,
        keys=("Alt+L",),
        lacks=_cannot,
    ),
    Action(
        "take.slower",
        "Half as fast: the chosen segment, or in to out",
        TAKE,
        _speed_by(1 / SPEED_STEP),
        keys=("Alt+,",),
        lacks=_cannot,
    ),
    Action(
        "take.faster",
        "Twice as fast: the chosen segment, or in to out",
        TAKE,
        _speed_by(SPEED_STEP),
        keys=("Alt+.",),
        lacks=_cannot,
    ),
    Action(
        "take.reset",
        "Play the take as captured again: reset its timing",
        TAKE,
        _sending(lambda session: ResetTime()),
        keys=("Alt+Shift+J",),
        lacks=lambda session: _cannot(session) or _no_timing(session),
    ),
)
