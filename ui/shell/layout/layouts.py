"""Layouts of the panels by name: those of the program, and those that the user keeps in the preferences."""

from __future__ import annotations

import logging

from imgui_bundle import ImVec2, imgui

from app.session.projects.preferences import MAX_LAYOUTS
from ui.panels.pieces.widgets import text_wrapped_dim
from ui.panels.state import LAYOUTS, UiState
from ui.shell.layout.remembering import present_layout, take_layout
from ui.style import theme
from ui.style.theme import Icon

logger = logging.getLogger(__name__)

TITLE = "Save the layout###layout name"
MAX_NAME = 60


class Layouts:
    """Takes up what was asked for; owns the name that is being typed."""

    def __init__(self) -> None:
        self._name = ""
        self._is_new = False

    def take_kept(self, ui: UiState) -> bool:
        """Between two frames: show the kept layout that was asked for. Whether there was one to show."""
        name = ui.wishes.layout
        if name is None or name not in ui.preferences.layouts:
            return False
        ui.wishes.layout = None
        ui.is_picture_only = False
        if take_layout(ui.preferences.layouts[name]):
            return True
        logger.warning("the layout %s was made for other panels and is not shown", ascii(name))
        return False

    def take_own(self, ui: UiState) -> str | None:
        """The name of the program's own layout that was asked for, once; None without one."""
        name = ui.wishes.layout
        if name is None or name in ui.preferences.layouts:
            return None
        ui.wishes.layout = None
        ui.is_picture_only = False
        return name if name in LAYOUTS else LAYOUTS[0]

    def draw(self, ui: UiState) -> None:
        """Forget the layout that was to be removed, and ask for a name where one is to be kept."""
        if ui.wishes.layout_removed is not None:
            ui.preferences.layouts.pop(ui.wishes.layout_removed, None)
            ui.wishes.layout_removed = None
        if ui.wishes.is_layout_name:
            ui.wishes.is_layout_name = False
            self._name, self._is_new = "", True
            imgui.open_popup(TITLE)
        imgui.set_next_window_pos(imgui.get_main_viewport().get_center(), imgui.Cond_.always, ImVec2(0.5, 0.5))
        imgui.set_next_window_size(ImVec2(420, 0))
        flags = imgui.WindowFlags_.no_saved_settings | imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_resize
        is_open, _ = imgui.begin_popup_modal(TITLE, True, flags | imgui.WindowFlags_.no_nav_inputs)
        if is_open:
            self._draw_inside(ui)
            imgui.end_popup()

    def _draw_inside(self, ui: UiState) -> None:
        kept = ui.preferences.layouts
        imgui.text("Name of the layout")
        if self._is_new:
            self._is_new = False
            imgui.set_keyboard_focus_here()
        imgui.set_next_item_width(-1)
        is_agreed, typed = imgui.input_text("##name", self._name, imgui.InputTextFlags_.enter_returns_true)
        self._name = typed[:MAX_NAME]
        ui.mark("layout.name")
        name = self._name.strip()
        why_not = "" if name in kept or len(kept) < MAX_LAYOUTS else "There are too many layouts; remove one first."
        if name in LAYOUTS:
            why_not = "This name belongs to a built-in layout."
        if why_not:
            imgui.text_colored(imgui.ImVec4(*theme.ORANGE), f"{Icon.WARNING}  {why_not}")
        else:
            text_wrapped_dim(
                "It replaces the layout of this name." if name in kept else "It is saved for all projects."
            )
        imgui.begin_disabled(not name or bool(why_not))
        is_agreed |= imgui.button("Save", ImVec2(120, 0))
        ui.mark("layout.save")
        imgui.end_disabled()
        imgui.same_line()
        is_left = imgui.button("Cancel", ImVec2(120, 0)) or imgui.is_key_pressed(imgui.Key.escape, False)
        if is_agreed and name and not why_not:
            kept[name] = present_layout()
            is_left = True
        if is_left:
            imgui.close_current_popup()
            ui.redraw_within(0.0)
