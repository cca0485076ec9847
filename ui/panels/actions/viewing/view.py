"""Actions on where one looks from."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from app.playback.views.views import COUNTS
from app.session.session_view import SessionView
from app.session.showing.look_commands import ActivateView, HomeView, LookThrough, ShowViews
from ui.panels.actions.action import VIEW, Action, Run
from ui.panels.state import Dispatch, UiState


def _camera_by(step: int) -> Run:
    def hop(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        if ui.selecting.kind == "brush":
            ui.selecting.resize(step)
            return
        n_cameras = len(session.rig)
        shown = session.view.look_through
        if shown is None:
            dispatch(LookThrough(nearest_camera(session)))
        else:
            dispatch(LookThrough((shown + step) % n_cameras))

    return hop


def _home(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(HomeView())


def nearest_camera(session: SessionView) -> int:
    """The capture camera that looks most like the current view: near in place and direction."""
    rig = session.rig
    pose = session.view.shown_pose
    distances = np.linalg.norm(rig.centers - pose.standpoint, axis=1)
    spread = max(float(np.linalg.norm(rig.centers - rig.centers.mean(0), axis=1).max()), 1e-9)
    turns = 1.0 - rig.forwards @ pose.forward
    return int(np.argmin(distances / spread + turns))


def _show_views(n: int) -> Run:
    def show(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        dispatch(ShowViews(n))

    return show


def _shows(n: int) -> Callable[[SessionView], bool]:
    return lambda session: session.views.n_shown == n


def next_layout(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """From one view to two, to four, and back to one."""
    dispatch(ShowViews(COUNTS[(COUNTS.index(session.views.n_shown) + 1) % len(COUNTS)]))


def _next_view(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(ActivateView((session.views.active_index + 1) % session.views.n_shown))


def _one_view(session: SessionView) -> str:
    return "There is only one view." if session.views.n_shown == 1 else ""


ACTIONS = (
    Action("view.home", "Frame the whole scene", VIEW, _home, keys=("F",)),
    Action(
        "view.previous_camera",
        "Look through the previous camera; with a brush, shrink it",
        VIEW,
        _camera_by(-1),
        keys=("[",),
        repeats=True,
    ),
    Action(
        "view.next_camera",
        "Look through the next camera; with a brush, enlarge it",
        VIEW,
        _camera_by(1),
        keys=("]",),
        repeats=True,
    ),
    Action("view.one", "One view", VIEW, _show_views(1), is_on=_shows(1)),
    Action("view.two", "Two views side by side", VIEW, _show_views(2), is_on=_shows(2)),
    Action("view.four", "Four views", VIEW, _show_views(4), is_on=_shows(4)),
    Action("view.next_layout", "One, two or four views", VIEW, next_layout, keys=("V",)),
    Action("view.next_view", "Activate the next view", VIEW, _next_view, keys=("Shift+V",), lacks=_one_view),
)
