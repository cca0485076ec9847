"""Every action, and the keys that run them."""

from __future__ import annotations

from imgui_bundle import imgui

from app.session.notices import Notices
from app.session.session_view import SessionView
from ui.panels.actions import copying, doctor, exporting, playing, time, window
from ui.panels.actions.action import Action
from ui.panels.actions.clips import clips, mending, training
from ui.panels.actions.editing import (
    camera_path,
    deleting,
    editing,
    excluding,
    marking,
    objects,
    selecting,
    timing,
    volume_keys,
)
from ui.panels.actions.viewing import bookmarks, compare, heat, modes, navigation, view
from ui.panels.panel_keys import belongs_to_panel
from ui.panels.state import Dispatch, UiState

ACTIONS: tuple[Action, ...] = (
    *time.ACTIONS,
    *playing.ACTIONS,
    *timing.ACTIONS,
    *view.ACTIONS,
    *navigation.ACTIONS,
    *bookmarks.ACTIONS,
    *compare.ACTIONS,
    *modes.ACTIONS,
    *heat.ACTIONS,
    *editing.ACTIONS,
    *copying.ACTIONS,
    *selecting.ACTIONS,
    *objects.ACTIONS,
    *marking.ACTIONS,
    *deleting.ACTIONS,
    *camera_path.ACTIONS,
    *volume_keys.ACTIONS,
    *training.ACTIONS,
    *clips.ACTIONS,
    *mending.ACTIONS,
    *excluding.ACTIONS,
    *doctor.ACTIONS,
    *exporting.ACTIONS,
    *window.ACTIONS,
)


def handle_keys(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Run the actions of keys pressed since the last frame, or say why not. Text fields keep their keys."""
    io = imgui.get_io()
    if ui.is_help_open and any(imgui.is_key_pressed(key, False) for key in (imgui.Key.escape, imgui.Key.f1)):
        ui.is_help_open = False
        return
    if io.want_text_input or ui.is_popup_open:  # the key that closes a menu does nothing else
        return
    for action in ACTIONS:
        keys = (key for key in ui.keys.keys(action) if not belongs_to_panel(key, ui))
        if not any(key.is_pressed(repeats=action.repeats) for key in keys):
            continue
        why_not = action.why_not(session, ui)
        if not why_not:
            action.run(session, dispatch, ui)
        elif not action.needs_choosing:  # Escape, Enter and the like, which end nothing at other times
            _say(session.notices, why_not, action.text)


def _say(notices: Notices, why_not: str, what: str) -> None:
    """Report once why a key does nothing, however often it is pressed."""
    if all((notice.title, notice.detail) != (why_not, what) for notice in notices):
        notices.add("info", why_not, what)
