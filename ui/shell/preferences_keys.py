"""The page of the preferences where keys are given to actions: press a new one, decide whether to take it from another
action, or go back to the action's own keys.
"""

from __future__ import annotations

from imgui_bundle import ImVec2, ImVec4, imgui

from ui.panels.actions.action import Action
from ui.panels.actions.key import pressed_label
from ui.panels.actions.table import ACTIONS
from ui.panels.pieces.widgets import primary_button, text_wrapped_dim
from ui.panels.state import UiState
from ui.shell.finding.fuzzy import match
from ui.style import theme
from ui.style.theme import Icon

ASK = "Press a key###new key"
KEYS_WIDTH = 180.0
BUTTONS_WIDTH = 68.0


class KeysPage:
    """Owns the text searched for, and the key that is being asked for."""

    def __init__(self) -> None:
        self._typed = ""
        self._asked: Action | None = None
        self._pressed = ""
        self._is_new = False

    @property
    def is_asking(self) -> bool:
        """Is a key being asked for?"""
        return self._asked is not None

    def draw(self, ui: UiState) -> None:
        """A list of all actions with their keys; a click asks for another key."""
        imgui.set_next_item_width(max(imgui.get_content_region_avail().x - 190, 120))
        self._typed = imgui.input_text_with_hint("##filter", "Find an action or a key", self._typed)[1]
        ui.mark("keys.filter")
        imgui.same_line()
        imgui.begin_disabled(not ui.keys.chosen)
        if imgui.button("Reset all keys", ImVec2(-1, 0)):
            ui.keys.reset_all()
        ui.mark("keys.reset_all")
        imgui.end_disabled()
        flags = imgui.TableFlags_.row_bg | imgui.TableFlags_.scroll_y | imgui.TableFlags_.borders_inner_h
        is_drawn = imgui.begin_table("keys", 3, flags, ImVec2(0, imgui.get_content_region_avail().y))
        if is_drawn:
            imgui.table_setup_column("Action", imgui.TableColumnFlags_.width_stretch)
            imgui.table_setup_column("Key", imgui.TableColumnFlags_.width_fixed, KEYS_WIDTH)
            imgui.table_setup_column("##buttons", imgui.TableColumnFlags_.width_fixed, BUTTONS_WIDTH)
            imgui.table_setup_scroll_freeze(0, 1)
            imgui.table_headers_row()
            for action in ACTIONS:
                keys = ", ".join(ui.keys.labels(action))
                if match(self._typed, action.text) is not None or match(self._typed, keys) is not None:
                    self._draw_row(action, keys, ui)
            imgui.end_table()
        self._draw_question(ui)

    def _draw_row(self, action: Action, keys: str, ui: UiState) -> None:
        imgui.push_id(action.id)
        imgui.table_next_row()
        imgui.table_next_column()
        imgui.align_text_to_frame_padding()
        imgui.push_text_wrap_pos(0.0)
        imgui.text(action.text)
        imgui.pop_text_wrap_pos()
        imgui.table_next_column()
        if imgui.button(f"{keys or 'none'}###key", ImVec2(-1, 0)):
            self._asked, self._pressed, self._is_new = action, "", True
        ui.mark(f"keys.{action.id}")
        imgui.set_item_tooltip("Press Enter or click to choose another key")
        imgui.table_next_column()
        if imgui.button(f"{Icon.CLOSE}##none", ImVec2(28, 0)):
            ui.keys.clear(action)
        ui.mark(f"keys.{action.id}.clear")
        imgui.set_item_tooltip("No key")
        imgui.same_line(0, 4)
        imgui.begin_disabled(not ui.keys.is_changed(action))
        if imgui.button(f"{Icon.UNDO}##own", ImVec2(28, 0)):
            ui.keys.reset(action, ACTIONS)
        ui.mark(f"keys.{action.id}.reset")
        imgui.end_disabled()
        imgui.set_item_tooltip(f"Back to {', '.join(action.keys) or 'no key'}")
        imgui.pop_id()

    def _draw_question(self, ui: UiState) -> None:
        action = self._asked
        if action is None:
            return
        if self._is_new:
            imgui.open_popup(ASK)
        imgui.set_next_window_pos(imgui.get_main_viewport().get_center(), imgui.Cond_.always, ImVec2(0.5, 0.5))
        imgui.set_next_window_size(ImVec2(440, 0))
        flags = imgui.WindowFlags_.no_saved_settings | imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_resize
        is_open, _ = imgui.begin_popup_modal(ASK, True, flags | imgui.WindowFlags_.no_nav_inputs)
        if not is_open:
            if not self._is_new:
                self._asked = None
            return
        if self._draw_asking(action, ui):
            self._asked = None
            imgui.close_current_popup()
            ui.redraw_within(0.0)
        imgui.end_popup()
        self._is_new = False

    def _draw_asking(self, action: Action, ui: UiState) -> bool:
        """Returns whether it is answered."""
        imgui.push_text_wrap_pos(0.0)
        imgui.text(action.text)
        imgui.pop_text_wrap_pos()
        pressed = "" if self._is_new else pressed_label()  # the key that led here is not the answer
        others = [other for other in ui.keys.owners(self._pressed, ACTIONS)] if self._pressed else []
        others = [other for other in others if other.id != action.id]
        if not others:
            text_wrapped_dim("Press the new key, with Ctrl, Shift or Alt if you like. Escape cancels.")
            if pressed == "Escape":
                return True
            if pressed:
                self._pressed = pressed
                if any(other.id != action.id for other in ui.keys.owners(pressed, ACTIONS)):
                    ui.redraw_within(0.0)
                    return False
                ui.keys.assign(action, pressed, ACTIONS)
                return True
            return self._cancelled(ui)
        imgui.push_text_wrap_pos(0.0)
        names = ", ".join(f'"{_text(other.id)}"' for other in others)
        imgui.text_colored(ImVec4(*theme.ORANGE), f"{Icon.WARNING}  {self._pressed} is already used by: {names}.")
        imgui.pop_text_wrap_pos()
        is_taken = primary_button(f"Use {self._pressed}", ImVec2(170, 0), ui) or pressed == "Enter"
        ui.mark("keys.take")
        imgui.same_line()
        if is_taken:
            ui.keys.assign(action, self._pressed, ACTIONS)
        return is_taken or pressed == "Escape" or self._cancelled(ui)

    def _cancelled(self, ui: UiState) -> bool:
        is_cancelled = imgui.button("Cancel", ImVec2(110, 0))
        ui.mark("keys.cancel")
        return is_cancelled


def _text(action_id: str) -> str:
    return next(action.text for action in ACTIONS if action.id == action_id)
