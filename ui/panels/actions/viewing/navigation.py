"""Actions on the view's direction, framing and lens."""

from __future__ import annotations

import math

import numpy as np

from app.playback.views.scene_axes import AXIS_VIEWS, UP_AXES
from app.session.session_view import SessionView
from app.session.showing.look_commands import LookThrough
from ui.panels.actions.action import NAVIGATE, Action, Run
from ui.panels.picture.gestures import PRESETS
from ui.panels.state import Dispatch, UiState

LEAN_STEP = math.radians(5.0)
FOV_STEP = 1.1
ANCHOR_SHARE = 0.04
"""Size of the part framed around an anchor, as a share of the scene's radius."""
_AXIS_KEYS = {
    "front": ("Num 1", "Alt+1"),
    "back": ("Ctrl+Num 1", "Ctrl+Alt+1"),
    "right": ("Num 3", "Alt+3"),
    "left": ("Ctrl+Num 3", "Ctrl+Alt+3"),
    "top": ("Num 7", "Alt+7"),
    "bottom": ("Ctrl+Num 7", "Ctrl+Alt+7"),
}


def frame_all(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """The whole scene, seen from the same side."""
    view = session.view
    if view.rig is not None and len(view.rig):
        view.frame(view.rig.focus_point(), 0.5 * view.radius)


def frame_selection(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """The highlighted region, else the sphere that is being chosen, else the anchor that was pointed at, else the
    pivot."""
    view, tool, regions = session.view, ui.regions, session.regions.regions
    region = tool.sphere
    if tool.highlighted is not None and tool.highlighted < len(regions):
        region = regions[tool.highlighted]
    if region is not None:
        low, high = np.array(region.low), np.array(region.high)
        view.frame((low + high) / 2, float(np.linalg.norm(high - low)) / 2)
    elif ui.pointed_anchor is not None:
        view.frame(ui.pointed_anchor, ANCHOR_SHARE * view.radius)
    else:
        view.frame(view.shown_pose.pivot, 0.25 * view.radius)


def toggle_orthographic(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Perspective or none."""
    session.view.set_orthographic(not session.view.is_orthographic)


def _look_along(name: str) -> Run:
    def look(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        session.view.look_along(name)

    return look


def _lean(radians: float) -> Run:
    def lean(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        if session.view.look_through is not None:
            dispatch(LookThrough(None))
        session.view.lean(radians)

    return lean


def _stand_upright(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    session.view.stand_upright()


def _scale_fov(factor: float) -> Run:
    def scale(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        if session.view.look_through is not None:
            dispatch(LookThrough(None))
        session.view.set_fov(session.view.fov_y * factor)

    return scale


def _set_up(name: str) -> Run:
    def set_up(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        session.view.set_up_axis(name)

    return set_up


def _choose_preset(name: str) -> Run:
    def choose(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        ui.navigation.preset_name = name

    return choose


def _toggle_easing(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.navigation.is_motion_reduced = not ui.navigation.is_motion_reduced


def up_words(name: str) -> str:
    """How the window calls one of UP_AXES."""
    return "as the cameras suggest" if UP_AXES[name] is None else name.upper()


def _up(name: str) -> Action:
    return Action(
        f"view.up_{name}",
        f"Up: {up_words(name)}",
        NAVIGATE,
        _set_up(name),
        is_on=lambda session: session.view.up_axis == name,
    )


def _axis(name: str) -> Action:
    words = {"front": "the front", "back": "the back", "right": "the right", "left": "the left"}
    text = f"Look from {words[name]}" if name in words else f"Look from {'above' if name == 'top' else 'below'}"
    return Action(f"view.{name}", text, NAVIGATE, _look_along(name), keys=_AXIS_KEYS[name])


ACTIONS = (
    Action("view.frame_all", "Frame the whole scene from this side", NAVIGATE, frame_all, keys=("Alt+F",)),
    Action(
        "view.frame_selection",
        "Frame what is highlighted or pointed at, else the pivot",
        NAVIGATE,
        frame_selection,
        keys=("Shift+F", "Num ."),
    ),
    *(_axis(name) for name in AXIS_VIEWS),
    Action(
        "view.orthographic",
        "Orthographic view, without perspective",
        NAVIGATE,
        toggle_orthographic,
        keys=("Num 5", "Alt+5"),
        is_on=lambda session: session.view.is_orthographic,
    ),
    Action("view.lean_left", "Roll left", NAVIGATE, _lean(-LEAN_STEP), keys=("Shift+[",), repeats=True),
    Action("view.lean_right", "Roll right", NAVIGATE, _lean(LEAN_STEP), keys=("Shift+]",), repeats=True),
    Action("view.upright", "Reset the roll", NAVIGATE, _stand_upright, keys=("Shift+\\",)),
    Action("view.wider", "Wider field of view", NAVIGATE, _scale_fov(FOV_STEP), keys=("Alt+-",), repeats=True),
    Action(
        "view.narrower", "Narrower field of view", NAVIGATE, _scale_fov(1 / FOV_STEP), keys=("Alt++",), repeats=True
    ),
    *(_up(name) for name in UP_AXES),
    *(
        Action(
            f"navigation.{name}", f"Mouse preset: {preset.title}", NAVIGATE, _choose_preset(name), needs_capture=False
        )
        for name, preset in PRESETS.items()
    ),
    Action("navigation.eased", "Smooth view moves on or off", NAVIGATE, _toggle_easing, needs_capture=False),
)
