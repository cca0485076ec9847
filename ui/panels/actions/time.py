"""Actions on time: the playhead, playing, clips."""

from __future__ import annotations

import numpy as np

from app.playback.timeline import Timeline
from app.session.commands import SetFrame, TogglePlay
from ui.panels.actions.action import TIME, Action, ActionNeeds, Run
from ui.panels.state import Dispatch, UiState


def go_to_frame(timeline: Timeline, dispatch: Dispatch, frame_index: int) -> None:
    """Move the playhead, held inside the capture."""
    dispatch(SetFrame(int(np.clip(frame_index, 0, timeline.last_frame))))


def _step_by(n: int) -> Run:
    def step(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
        go_to_frame(session.timeline, dispatch, session.timeline.frame_index + n)

    return step


def _step_second(sign: int) -> Run:
    def step(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
        n = max(1, round(session.timeline.fps))
        go_to_frame(session.timeline, dispatch, session.timeline.frame_index + sign * n)

    return step


def _first_frame(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
    go_to_frame(session.timeline, dispatch, 0)


def _last_frame(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
    go_to_frame(session.timeline, dispatch, session.timeline.n_frames - 1)


def _previous_clip(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
    go_to_frame(session.timeline, dispatch, session.timeline.previous_clip_start(session.timeline.frame_index))


def _next_clip(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
    go_to_frame(session.timeline, dispatch, session.timeline.next_clip_start(session.timeline.frame_index))


def _toggle_play(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(TogglePlay())


def _toggle_every_frame(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
    session.timeline.is_every_frame = not session.timeline.is_every_frame


def _toggle_loop(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
    session.timeline.is_looping = not session.timeline.is_looping


ACTIONS = (
    Action("time.play", "Play or pause", TIME, _toggle_play, keys=("Space",)),
    Action("time.back", "One frame back", TIME, _step_by(-1), keys=("Left",), repeats=True),
    Action("time.forward", "One frame forward", TIME, _step_by(1), keys=("Right",), repeats=True),
    Action("time.second_back", "One second back", TIME, _step_second(-1), keys=("Shift+Left",), repeats=True),
    Action("time.second_forward", "One second forward", TIME, _step_second(1), keys=("Shift+Right",), repeats=True),
    Action("time.first", "First frame", TIME, _first_frame, keys=("Home",)),
    Action("time.last", "Last frame", TIME, _last_frame, keys=("End",)),
    Action(
        "time.previous_clip", "Start of this or the previous clip", TIME, _previous_clip, keys=("Up",), repeats=True
    ),
    Action("time.next_clip", "Start of the next clip", TIME, _next_clip, keys=("Down",), repeats=True),
    Action(
        "time.loop",
        "Loop on or off",
        TIME,
        _toggle_loop,
        keys=("L",),
        is_on=lambda session: session.timeline.is_looping,
    ),
    Action(
        "time.every_frame",
        "Play every frame, or skip frames to keep the speed",
        TIME,
        _toggle_every_frame,
        keys=("E",),
        is_on=lambda session: session.timeline.is_every_frame,
    ),
)
