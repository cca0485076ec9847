"""Actions on camera paths."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from app.session.paths.path_commands import (
    AimCameraKey,
    ChooseCameraPath,
    CloseCameraPath,
    DeleteCameraPath,
    LookAlongPath,
    MakeFlyThrough,
    MakeTurntable,
    NewCameraPath,
    PathCommand,
    SetCameraKey,
    TimeCameraKey,
)
from app.session.paths.path_edits import key_at
from app.session.session_view import SessionView
from engine.camera.camera_path import CameraPath
from ui.panels.actions.action import PATH, Action, Run
from ui.panels.picture.key_grip import choose_key
from ui.panels.state import PATHS, Dispatch, UiState
from ui.viewport.path_tool import nudged


def begin_path(session: SessionView, dispatch: Dispatch, ui: UiState, command: PathCommand) -> None:
    """Make a path, or add to it, with the panel in front; where nothing can be changed the panel says why."""
    ui.wanted_panel = PATHS
    if session.paths.can_edit:
        dispatch(command)


def nudge_key(session: SessionView, dispatch: Dispatch, ui: UiState, direction: tuple[float, float, float]) -> None:
    """Move the chosen key by a step along the axes of the view: to the right, down, forward."""
    status, pose = session.paths, session.view.shown_pose
    if status.key is not None and status.chosen_key is not None and status.can_edit:
        gesture = ui.paths.press_gesture()
        dispatch(
            nudged(
                status.chosen_key,
                status.key,
                pose.rotation,
                pose.standpoint,
                np.array(direction),
                gesture=gesture,
            )
        )


def _make(make: Callable[[], PathCommand]) -> Run:
    def run(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        begin_path(session, dispatch, ui, make())

    return run


def _set_key(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    begin_path(session, dispatch, ui, SetCameraKey())


def _along(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(LookAlongPath(not session.paths.is_along))


def _close(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    if session.paths.path is not None:
        dispatch(CloseCameraPath(not session.paths.path.is_closed))


def _delete(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    begin_path(session, dispatch, ui, DeleteCameraPath())


def _next_path(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    status = session.paths
    ui.wanted_panel = PATHS
    if status.chosen is not None:
        dispatch(ChooseCameraPath((status.chosen + 1) % len(status.paths)))


def _key_by(step: int) -> Run:
    def go(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        path = session.paths.path
        if path is not None and path.keys:
            choose_key(dispatch, ui, key_beside(path, session.timeline.frame_index, step), is_going=True)

    return go


def key_beside(path: CameraPath, frame_index: int, step: int) -> int:
    """Number of the key before or after a frame; the first or the last one where there is none."""
    there = key_at(path, frame_index)
    if there is not None:
        return min(max(there + step, 0), len(path.keys) - 1)
    n_before = sum(key.frame < frame_index for key in path.keys)
    return min(max(n_before - (1 if step < 0 else 0), 0), len(path.keys) - 1)


def _time_by(step: int) -> Run:
    def move(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        status = session.paths
        if status.key is not None and status.chosen_key is not None and status.can_edit:
            dispatch(TimeCameraKey(status.chosen_key, status.key.frame + step, ui.paths.press_gesture()))

    return move


def _aim(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    if session.paths.chosen_key is not None:
        dispatch(AimCameraKey(session.paths.chosen_key))


def _cannot_edit(session: SessionView) -> str:
    return "" if session.paths.can_edit else session.paths.why_not or "Camera paths cannot be changed now."


def _no_path(session: SessionView) -> str:
    return "There is no camera path yet." if session.paths.path is None else ""


def _no_keys(session: SessionView) -> str:
    path = session.paths.path
    return _no_path(session) or ("The camera path has no keys yet." if path is None or not path.keys else "")


def _cannot_edit_path(session: SessionView) -> str:
    return _cannot_edit(session) or _no_path(session)


def _cannot_edit_key(session: SessionView) -> str:
    return _cannot_edit(session) or ("No camera key is chosen." if session.paths.key is None else "")


def _is_loop(session: SessionView) -> bool:
    return session.paths.path is not None and session.paths.path.is_closed


ACTIONS = (
    Action(
        "path.key", "Add a camera key at the playhead from this view", PATH, _set_key, keys=("C",), lacks=_cannot_edit
    ),
    Action(
        "path.along",
        "Follow the camera path during playback",
        PATH,
        _along,
        keys=("P",),
        is_on=lambda session: session.paths.is_along,
        lacks=_no_keys,
    ),
    Action("path.previous_key", "Previous camera key", PATH, _key_by(-1), keys=("Alt+Left",), lacks=_no_keys),
    Action("path.next_key", "Next camera key", PATH, _key_by(1), keys=("Alt+Right",), lacks=_no_keys),
    Action(
        "path.earlier",
        "Move the chosen camera key one frame earlier",
        PATH,
        _time_by(-1),
        keys=("Alt+Shift+Left",),
        repeats=True,
        lacks=_cannot_edit_key,
    ),
    Action(
        "path.later",
        "Move the chosen camera key one frame later",
        PATH,
        _time_by(1),
        keys=("Alt+Shift+Right",),
        repeats=True,
        lacks=_cannot_edit_key,
    ),
    Action("path.aim", "Set the chosen camera key to this view", PATH, _aim, keys=("Shift+C",), lacks=_cannot_edit_key),
    Action("path.new", "New camera path from this view", PATH, _make(NewCameraPath), lacks=_cannot_edit),
    Action(
        "path.turntable", "New turntable around the centre of this view", PATH, _make(MakeTurntable), lacks=_cannot_edit
    ),
    Action(
        "path.fly_through", "New fly-through from camera to camera", PATH, _make(MakeFlyThrough), lacks=_cannot_edit
    ),
    Action("path.next", "Choose the next camera path", PATH, _next_path, lacks=_no_path),
    Action("path.loop", "Loop the camera path on or off", PATH, _close, is_on=_is_loop, lacks=_cannot_edit_path),
    Action("path.delete", "Delete the camera path", PATH, _delete, lacks=_cannot_edit_path),
)
