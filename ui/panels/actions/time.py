"""Actions on time: the playhead, clips, markers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from app.playback.timeline import Timeline
from app.session.editing.edit_commands import RemoveMarker
from app.session.session_view import SessionView
from app.session.showing.look_commands import FollowTraining, SetFrame, TogglePlay
from ui.panels.actions.action import TIME, Action, Run
from ui.panels.state import TIMELINE, Dispatch, UiState
from ui.panels.timeline.marker_box import mark_playhead


def go_to_frame(timeline: Timeline, dispatch: Dispatch, frame_index: int) -> None:
    """Move the playhead, held inside the capture."""
    dispatch(SetFrame(int(np.clip(frame_index, 0, timeline.last_frame))))


def _step_by(n: int) -> Run:
    def step(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        go_to_frame(session.timeline, dispatch, session.timeline.frame_index + n)

    return step


def _step_second(sign: int) -> Run:
    def step(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        n = max(1, round(session.timeline.fps))
        go_to_frame(session.timeline, dispatch, session.timeline.frame_index + sign * n)

    return step


def _first_frame(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    go_to_frame(session.timeline, dispatch, 0)


def _last_frame(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    if session.timeline.frame_index == session.timeline.last_frame:
        dispatch(FollowTraining())
    else:
        go_to_frame(session.timeline, dispatch, session.timeline.last_frame)


def _follow(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(FollowTraining(not session.timeline.is_following))


def _previous_clip(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    go_to_frame(session.timeline, dispatch, session.timeline.previous_clip_start(session.timeline.frame_index))


def _next_clip(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    go_to_frame(session.timeline, dispatch, session.timeline.next_clip_start(session.timeline.frame_index))


def _toggle_play(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(TogglePlay())


def _marker_by(direction: int) -> Run:
    def jump(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        timeline = session.timeline
        find = timeline.markers.after if direction > 0 else timeline.markers.before
        marker = find(timeline.frame_index)
        if marker is not None:
            go_to_frame(timeline, dispatch, marker.frame_index)

    return jump


def _no_marker(direction: int) -> Callable[[SessionView], str]:
    def why_not(session: SessionView) -> str:
        markers = session.timeline.markers
        find = markers.after if direction > 0 else markers.before
        is_there = find(session.timeline.frame_index) is not None
        return "" if is_there else f"There is no marker {'after' if direction > 0 else 'before'} this frame."

    return why_not


def _no_marker_here(session: SessionView) -> str:
    is_there = session.timeline.markers.at(session.timeline.frame_index) is not None
    return "" if is_there else "This frame has no marker."


def _jump(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.timeline.is_jump_wanted = True
    ui.wanted_panel = TIMELINE


def _mark(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    mark_playhead(session.timeline, dispatch, ui)
    ui.wanted_panel = TIMELINE


def _unmark(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    if session.timeline.markers.at(session.timeline.frame_index) is not None:
        dispatch(RemoveMarker(session.timeline.frame_index))


ACTIONS = (
    Action("time.play", "Play or pause", TIME, _toggle_play, keys=("Space",)),
    Action("time.back", "One frame back", TIME, _step_by(-1), keys=("Left", ","), repeats=True),
    Action("time.forward", "One frame forward", TIME, _step_by(1), keys=("Right", "."), repeats=True),
    Action("time.second_back", "One second back", TIME, _step_second(-1), keys=("Shift+Left",), repeats=True),
    Action("time.second_forward", "One second forward", TIME, _step_second(1), keys=("Shift+Right",), repeats=True),
    Action("time.first", "First frame", TIME, _first_frame, keys=("Home",)),
    Action("time.last", "Last frame; again: follow training", TIME, _last_frame, keys=("End",)),
    Action(
        "time.follow",
        "Follow training: stay in the clip with the newest state",
        TIME,
        _follow,
        is_on=lambda session: session.timeline.is_following,
    ),
    Action(
        "time.previous_clip", "Start of this or the previous clip", TIME, _previous_clip, keys=("Up",), repeats=True
    ),
    Action("time.next_clip", "Start of the next clip", TIME, _next_clip, keys=("Down",), repeats=True),
    Action("time.jump", "Go to a frame, time or clip", TIME, _jump, keys=("Ctrl+G",)),
    Action("time.mark", "Add a marker at this frame, or name it", TIME, _mark, keys=("Ctrl+M",)),
    Action(
        "time.unmark",
        "Remove the marker of this frame",
        TIME,
        _unmark,
        keys=("Ctrl+Shift+M",),
        lacks=_no_marker_here,
    ),
    *(
        Action(f"time.{name}_marker", words, TIME, _marker_by(step), keys=(key,), repeats=True, lacks=_no_marker(step))
        for name, words, step, key in (
            ("previous", "Previous marker", -1, "Shift+Up"),
            ("next", "Next marker", 1, "Shift+Down"),
        )
    ),
)
