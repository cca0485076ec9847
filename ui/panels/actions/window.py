"""Actions on the window itself."""

from __future__ import annotations

from typing import Any

from ui.panels.actions.action import WINDOW, Action, ActionNeeds, Run
from ui.panels.state import Dispatch, UiState
from ui.style.ui_scale import next_choice


def choose_scale(ui: UiState, scale: float | None) -> None:
    """Draw the interface at another size from the next frame on; None follows the screen."""
    ui.scale.chosen = scale
    ui.redraw_within(0.0)


def _scale_by(step: int) -> Run:
    def change(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
        choose_scale(ui, next_choice(ui.scale.wanted, step))

    return change


def _reset_scale(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
    choose_scale(ui, None)


def _menu(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
    ui.is_menu_wanted = True


def _help(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
    ui.is_help_open = not ui.is_help_open


def _open(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
    ui.is_open_requested = True


def _quit(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
    ui.quit_requested = True


_ALWAYS: dict[str, Any] = {"needs_capture": False}

ACTIONS = (
    Action("window.open", "Open a capture or project folder", WINDOW, _open, keys=("Ctrl+O",), **_ALWAYS),
    Action("window.larger", "Larger interface", WINDOW, _scale_by(1), keys=("Ctrl++",), **_ALWAYS),
    Action("window.smaller", "Smaller interface", WINDOW, _scale_by(-1), keys=("Ctrl+-",), **_ALWAYS),
    Action("window.own_scale", "Interface at the screen's own size", WINDOW, _reset_scale, keys=("Ctrl+0",), **_ALWAYS),
    Action("window.menu", "Menus (also Alt); arrow keys work in them", WINDOW, _menu, keys=("F10",), **_ALWAYS),
    Action("window.help", "This sheet", WINDOW, _help, keys=("F1",), **_ALWAYS),
    Action("window.quit", "Quit; what was learned is kept", WINDOW, _quit, keys=("Ctrl+Q",), **_ALWAYS),
)
