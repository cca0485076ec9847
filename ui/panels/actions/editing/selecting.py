"""Actions that select: tools, and changes of the selection."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from app.session.editing.selection_commands import (
    ClearSelection,
    GrowSelection,
    Reselect,
    SelectAll,
    ShrinkSelection,
)
from app.session.session_view import SessionView
from ui.panels.actions.action import SELECT, Action, Run
from ui.panels.editing.edit_subject import invert_selection
from ui.panels.editing.panel.select_tools import all_moving, near_distance
from ui.panels.state import Dispatch, UiState
from ui.viewport.editing.select_tool import TOOL_WORDS, ToolKind


def _tool(kind: ToolKind) -> Run:
    def take(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        ui.regions.leave()
        ui.selecting.choose(kind)
        if ui.selecting.is_active:
            ui.show_edit()

    return take


def _invert(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    invert_selection(dispatch, ui)


def _send(make: Callable[[], Any]) -> Run:
    def send(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        dispatch(make())

    return send


def _by_distance(make: Callable[[float], Any]) -> Run:
    def send(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        distance = near_distance(session, ui.selecting)
        if distance > 0.0:
            dispatch(make(distance))

    return send


def _moving(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(all_moving(ui))


def _toggle(name: str) -> Run:
    def toggle(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        setattr(ui.selecting, name, not getattr(ui.selecting, name))

    return toggle


def _nothing_to_select(session: SessionView) -> str:
    return "" if session.selection.can_select else "No Gaussians to select in this frame."


def _nothing_selected(session: SessionView) -> str:
    return "" if session.selection.n_gaussians else "Nothing is selected."


def _no_before(session: SessionView) -> str:
    return "" if session.selection.has_before else "No previous selection."


_TOOL_KEYS: dict[ToolKind, str] = {
    "rectangle": "R",
    "lasso": "Shift+R",
    "brush": "Ctrl+R",
    "box": "Alt+R",
    "sphere": "Ctrl+Shift+R",
    "prism": "Alt+Shift+R",
    "flood": "Y",
}
_ANY: dict[str, Any] = {"lacks": _nothing_to_select}
_SOME: dict[str, Any] = {"lacks": _nothing_selected}

ACTIONS = (
    *(
        Action(f"select.{kind}", f"Select with the tool {TOOL_WORDS[kind]}", SELECT, _tool(kind), keys=(key,), **_ANY)
        for kind, key in _TOOL_KEYS.items()
    ),
    Action("select.all", "Select everything that is shown", SELECT, _send(SelectAll), keys=("Ctrl+A",), **_ANY),
    Action("select.none", "Select nothing", SELECT, _send(ClearSelection), keys=("Ctrl+Shift+A",), **_SOME),
    Action("select.invert", "Invert the selection", SELECT, _invert, keys=("Ctrl+I",), **_ANY),
    Action(
        "select.before", "Restore the previous selection", SELECT, _send(Reselect), keys=("Alt+Z",), lacks=_no_before
    ),
    Action("select.grow", "Grow the selection", SELECT, _by_distance(GrowSelection), keys=("Ctrl+]",), **_SOME),
    Action("select.shrink", "Shrink the selection", SELECT, _by_distance(ShrinkSelection), keys=("Ctrl+[",), **_SOME),
    Action("select.moving", "Select everything that moves", SELECT, _moving, **_ANY),
    Action("select.visible", "Select visible Gaussians only, or through surfaces", SELECT, _toggle("is_visible_only")),
    Action("select.extent", "Select by extent, or by centre", SELECT, _toggle("is_by_extent")),
    Action("select.anchors", "Select whole anchors, or single Gaussians", SELECT, _toggle("is_whole_anchors")),
)
