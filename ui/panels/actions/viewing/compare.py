"""Actions on things shown next to or over the picture."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from app.playback.modes.view_modes import MODES
from app.session.session_view import SessionView
from app.session.showing.look_commands import LookThrough, SetCompare, SetCompareWith, ToggleOverlay
from app.status import CAPTURED, COMPARE_MODES, PROJECT
from ui.panels.actions.action import COMPARE, Action, Run
from ui.panels.actions.viewing.view import nearest_camera
from ui.panels.picture.comparison import shown_compare
from ui.panels.state import Dispatch, UiState

COMPARE_WORDS = {"off": "Off", "wipe": "Wipe", "side": "Side by side", "blink": "Blink"}
MARK_NAMES = ("show_frusta", "show_inherited", "show_residual")
"""The overlays that Tab shows or hides together."""


def set_compare(session: SessionView, dispatch: Dispatch, mode: str) -> None:
    """Compare with another picture; a captured one needs a camera, so the nearest one is taken from a free view."""
    other = session.overlays.compare_with
    if other == PROJECT and session.other_project is None:  # it was left together with the project that was open
        other = CAPTURED
        dispatch(SetCompareWith(other))
    if mode != "off" and other == CAPTURED and session.view.look_through is None:
        dispatch(LookThrough(nearest_camera(session)))
    dispatch(SetCompare(mode))


def _cycle_compare(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    shown = COMPARE_MODES.index(shown_compare(session))
    set_compare(session, dispatch, COMPARE_MODES[(shown + 1) % len(COMPARE_MODES)])


def set_other(session: SessionView, dispatch: Dispatch, other: str) -> None:
    """Compare with this picture from now on; wipe where nothing was compared."""
    dispatch(SetCompareWith(other))
    if other != session.overlays.mode and session.overlays.compare == "off":
        set_compare(session, dispatch, "wipe")


def _set_other(other: str) -> Run:
    def choose(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        set_other(session, dispatch, other)

    return choose


def _choose_project(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.wishes.is_comparison = True


def _has_other(other: str) -> Callable[[Any], bool]:
    return lambda session: session.overlays.compare_with == other


def _set_compare(mode: str) -> Run:
    def compare(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        set_compare(session, dispatch, mode)

    return compare


def _has_compare(mode: str) -> Callable[[Any], bool]:
    return lambda session: shown_compare(session) == mode


def _is_shown(name: str) -> Callable[[Any], bool]:
    return lambda session: bool(getattr(session.overlays, name))


def _are_marks_shown(session: SessionView) -> bool:
    return all(getattr(session.overlays, name) for name in MARK_NAMES)


def _toggle_overlays(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    is_all_shown = _are_marks_shown(session)
    for name in MARK_NAMES:
        if getattr(session.overlays, name) == is_all_shown:
            dispatch(ToggleOverlay(name))


def _toggle_overlay(name: str) -> Run:
    def toggle(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        dispatch(ToggleOverlay(name))

    return toggle


def cloud_overlay(session: SessionView) -> str:
    """The overlay that shows or hides the point cloud: in place of a trained picture, or where there is none."""
    wanted = session.wanted_frame()
    return "show_points" if wanted is None or not wanted.revision else "show_cloud"


def _is_cloud_shown(session: SessionView) -> bool:
    return bool(getattr(session.overlays, cloud_overlay(session)))


def _toggle_cloud(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(ToggleOverlay(cloud_overlay(session)))


def _overlay(name: str, text: str, key: str) -> Action:
    return Action(f"show.{name}", text, COMPARE, _toggle_overlay(name), keys=(key,), is_on=_is_shown(name))


ACTIONS = (
    Action(
        "compare.next",
        "Compare with another picture: wipe, side by side, blink, off",
        COMPARE,
        _cycle_compare,
        keys=("G",),
    ),
    *(
        Action(f"compare.{mode}", f"Compare: {words}", COMPARE, _set_compare(mode), is_on=_has_compare(mode))
        for mode, words in COMPARE_WORDS.items()
    ),
    Action(
        "compare.with_captured",
        "Compare with the captured picture",
        COMPARE,
        _set_other(CAPTURED),
        is_on=_has_other(CAPTURED),
    ),
    *(
        Action(
            f"compare.with_{mode.name}",
            f"Compare with mode: {mode.label}",
            COMPARE,
            _set_other(mode.name),
            is_on=_has_other(mode.name),
        )
        for mode in MODES.values()
    ),
    Action(
        "compare.project",
        "Compare with another project ...",
        COMPARE,
        _choose_project,
        is_on=_has_other(PROJECT),
    ),
    Action(
        "show.marks",
        "Show or hide cameras and anchors",
        COMPARE,
        _toggle_overlays,
        keys=("Tab",),
        is_on=_are_marks_shown,
    ),
    _overlay("show_frusta", "Show or hide cameras", "1"),
    _overlay("show_inherited", "Show or hide inherited anchors", "2"),
    _overlay("show_residual", "Show or hide residual anchors", "3"),
    Action(
        "show.cloud",
        "Show the point cloud, even in place of a trained picture",
        COMPARE,
        _toggle_cloud,
        keys=("4",),
        is_on=_is_cloud_shown,
    ),
    _overlay("show_regions", "Show or hide marked regions", "5"),
    _overlay("show_coverage", "Show or hide the space covered by inherited anchors", "9"),
    _overlay("show_trails", "Show or hide motion trails", "0"),
    _overlay("show_paths", "Show or hide the camera path", "Shift+P"),
)
