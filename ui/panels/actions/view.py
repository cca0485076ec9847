"""Actions on where one looks from."""

from __future__ import annotations

import numpy as np

from app.session.commands import HomeView, LookThrough
from engine.camera.projection import camera_center
from ui.panels.actions.action import VIEW, Action, ActionNeeds, Run
from ui.panels.state import Dispatch, UiState


def _camera_by(step: int) -> Run:
    def hop(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
        n_cameras = len(session.rig)
        shown = session.view.look_through
        if shown is None:
            dispatch(LookThrough(nearest_camera(session)))
        else:
            dispatch(LookThrough((shown + step) % n_cameras))

    return hop


def _home(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(HomeView())


def nearest_camera(session: ActionNeeds) -> int:
    """The capture camera that looks most like the current view: near in place and direction."""
    rig = session.rig
    world_to_camera = np.asarray(session.view.world_to_camera(), dtype=np.float64)
    distances = np.linalg.norm(rig.centers - camera_center(world_to_camera), axis=1)
    spread = max(float(np.linalg.norm(rig.centers - rig.centers.mean(0), axis=1).max()), 1e-9)
    turns = 1.0 - rig.forwards @ world_to_camera[2, :3]
    return int(np.argmin(distances / spread + turns))


ACTIONS = (
    Action("view.home", "Frame the whole scene", VIEW, _home, keys=("F",)),
    Action("view.previous_camera", "Look through the previous camera", VIEW, _camera_by(-1), keys=("[",), repeats=True),
    Action("view.next_camera", "Look through the next camera", VIEW, _camera_by(1), keys=("]",), repeats=True),
)
