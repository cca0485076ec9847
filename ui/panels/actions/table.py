"""Every action, and the keys that run them."""

from __future__ import annotations

from imgui_bundle import imgui

from ui.panels.actions import compare, heat, marking, modes, playing, time, training, view, window
from ui.panels.actions.action import Action, ActionNeeds
from ui.panels.state import Dispatch, UiState

ACTIONS: tuple[Action, ...] = (
    *time.ACTIONS,
    *playing.ACTIONS,
    *view.ACTIONS,
    *compare.ACTIONS,
    *modes.ACTIONS,
    *heat.ACTIONS,
    *marking.ACTIONS,
    *training.ACTIONS,
    *window.ACTIONS,
)

MOUSE_HELP: tuple[tuple[str, str], ...] = (
    ("Left drag", "Orbit around the pivot"),
    ("Right drag", "Move the view sideways (also Shift + middle drag)"),
    ("Wheel", "Move nearer or farther (also Ctrl + middle drag)"),
    ("Click, wheel", "While a region is chosen: fix its place, change its size (Ctrl + wheel moves the view)"),
    ("Camera click", "Look through the camera whose pyramid it is"),
    ("Timeline drag", "Move through time"),
    ("White line drag", "Wipe between the two pictures that are compared"),
    ("Hold B", "See the picture that the render is compared with, alone"),
    ("Timeline wheel", "Move what is shown (also middle drag); with Ctrl closer or farther, double click for all"),
    ("Seam click", "Play around the boundary between two clips"),
    ("Folder drop", "Open it: a capture or a project"),
)


def handle_keys(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
    """Run the actions of keys pressed since the last frame. Text fields keep their keys."""
    io = imgui.get_io()
    if ui.is_help_open and imgui.is_key_pressed(imgui.Key.escape, False):
        ui.is_help_open = False
        return
    if io.want_text_input or ui.is_popup_open:  # the key that closes a menu does nothing else
        return
    for action in ACTIONS:
        if any(key.is_pressed(repeats=action.repeats) for key in action.parsed_keys) and action.is_offered(session, ui):
            action.run(session, dispatch, ui)
