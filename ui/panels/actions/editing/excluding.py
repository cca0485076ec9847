"""Actions that leave a camera, a frame or a painted part of pictures out of training."""

from __future__ import annotations

from app.session.exclusions.exclusion_commands import ExcludeCameras, ExcludeFrames
from app.session.session_view import SessionView
from ui.panels.actions.action import TRAIN, Action, Run
from ui.panels.state import Dispatch, UiState


def _no_camera(session: SessionView) -> str:
    return "" if session.view.look_through is not None else "Look through a camera first."


def _exclude_camera(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    camera = session.view.look_through
    if camera is not None:
        dispatch(ExcludeCameras((camera,), not _is_camera_out(session)))


def _is_camera_out(session: SessionView) -> bool:
    camera = session.view.look_through
    return camera is not None and session.rig.names[camera] in session.exclusions.cameras


def _exclude_picture(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    camera, frame = session.view.look_through, session.timeline.frame_index
    if camera is not None:
        dispatch(ExcludeFrames(frame, frame + 1, camera, not _is_out(session, session.rig.names[camera])))


def _exclude_frame(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    frame = session.timeline.frame_index
    dispatch(ExcludeFrames(frame, frame + 1, None, not _is_out(session, None)))


def _is_out(session: SessionView, name: str | None) -> bool:
    frame = session.timeline.frame_index
    return any(one.camera == name and one.first <= frame < one.stop for one in session.exclusions.frames)


def _paint(scope: str) -> Run:
    def paint(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        camera = session.view.look_through
        if ui.masks.is_active and ui.masks.scope == scope:
            ui.masks.stop()
        elif camera is not None:
            ui.masks.start(camera, scope)

    return paint


ACTIONS = (
    Action(
        "exclude.camera",
        "Exclude this camera from training, or include it",
        TRAIN,
        _exclude_camera,
        keys=("Alt+X",),
        is_on=_is_camera_out,
        lacks=_no_camera,
        menu="Train/Exclude",
    ),
    Action(
        "exclude.picture",
        "Exclude this frame of this camera from training, or include it",
        TRAIN,
        _exclude_picture,
        keys=("Shift+X",),
        lacks=_no_camera,
        menu="Train/Exclude",
    ),
    Action(
        "exclude.frame",
        "Exclude this frame of all cameras from training, or include it",
        TRAIN,
        _exclude_frame,
        is_on=lambda session: _is_out(session, None),
        menu="Train/Exclude",
    ),
    Action(
        "exclude.paint",
        "Paint a training mask for this camera",
        TRAIN,
        _paint("all"),
        keys=("Alt+N",),
        lacks=_no_camera,
        menu="Train/Exclude",
    ),
    Action(
        "exclude.paint_clip",
        "Paint a training mask for this camera, in this clip",
        TRAIN,
        _paint("clip"),
        lacks=_no_camera,
        menu="Train/Exclude",
    ),
    Action(
        "exclude.paint_frame",
        "Paint a training mask for this camera, in this frame",
        TRAIN,
        _paint("frame"),
        lacks=_no_camera,
        menu="Train/Exclude",
    ),
)
