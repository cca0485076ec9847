"""Actions on how time is played: which way, how fast, from where to where; and on what the timeline shows of it."""

from __future__ import annotations

from collections.abc import Callable

from app.playback.timeline import Timeline
from app.session.session_view import SessionView
from ui.panels.actions.action import PLAY, Action, Run
from ui.panels.state import TIMELINE, Dispatch, UiState


def _on_timeline(act: Callable[[Timeline], object]) -> Run:
    def run(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        act(session.timeline)

    return run


def _toggle_every_frame(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    session.timeline.toggle_every_frame()


def _toggle_loop(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    session.timeline.is_looping = not session.timeline.is_looping


def _zoom_by(n_steps: int) -> Run:
    def zoom(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        ui.timeline.zoom_at_playhead(n_steps, session.timeline)

    return zoom


def _pan_by(n_steps: int) -> Run:
    def pan(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        ui.timeline.pan(n_steps, session.timeline.n_frames)

    return pan


def _toggle_fit(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.timeline.toggle_fit(session.timeline)


def _next_unit(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.timeline.next_unit()


def _clip_menu(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.timeline.is_menu_wanted = True
    ui.wanted_panel = TIMELINE


ACTIONS = (
    Action(
        "play.backward", "Play backward; again: faster", PLAY, _on_timeline(lambda time: time.shuttle(-1)), keys=("J",)
    ),
    Action("play.stop", "Stop playing", PLAY, _on_timeline(Timeline.hold), keys=("K",)),
    Action(
        "play.forward", "Play forward; again: faster", PLAY, _on_timeline(lambda time: time.shuttle(1)), keys=("L",)
    ),
    Action("play.slower", "Play slower", PLAY, _on_timeline(lambda time: time.change_speed(-1)), keys=("Shift+,",)),
    Action("play.faster", "Play faster", PLAY, _on_timeline(lambda time: time.change_speed(1)), keys=("Shift+.",)),
    Action(
        "time.loop",
        "Loop on or off",
        PLAY,
        _toggle_loop,
        keys=("Ctrl+/",),
        is_on=lambda session: session.timeline.is_looping,
    ),
    Action(
        "time.every_frame",
        "Play every frame, or skip frames to keep the speed",
        PLAY,
        _toggle_every_frame,
        keys=("Shift+Space",),
        is_on=lambda session: session.timeline.plays_every_frame,
    ),
    Action("play.in", "Set the in point: play from this frame", PLAY, _on_timeline(Timeline.set_in), keys=("I",)),
    Action("play.out", "Set the out point: play up to this frame", PLAY, _on_timeline(Timeline.set_out), keys=("O",)),
    Action("play.whole", "Clear the in and out points", PLAY, _on_timeline(Timeline.clear_range), keys=("X",)),
    Action(
        "play.around",
        "Play around the nearest seam between clips, on or off",
        PLAY,
        _on_timeline(Timeline.toggle_around),
        keys=("/",),
        is_on=lambda session: session.timeline.around is not None,
    ),
    Action("timeline.fit", "Timeline: the whole capture, or this clip", PLAY, _toggle_fit, keys=("Z",)),
    Action("timeline.closer", "Timeline: zoom in", PLAY, _zoom_by(1), keys=("Alt+Page Up",), repeats=True),
    Action("timeline.farther", "Timeline: zoom out", PLAY, _zoom_by(-1), keys=("Alt+Page Down",), repeats=True),
    Action("timeline.earlier", "Timeline: scroll back", PLAY, _pan_by(-1), keys=("Shift+Page Up",), repeats=True),
    Action("timeline.later", "Timeline: scroll forward", PLAY, _pan_by(1), keys=("Shift+Page Down",), repeats=True),
    Action("timeline.unit", "Timeline: frames, seconds or timecode", PLAY, _next_unit, keys=("U",)),
    Action("timeline.menu", "Menu of this clip", PLAY, _clip_menu, keys=("Shift+F10",)),
)
