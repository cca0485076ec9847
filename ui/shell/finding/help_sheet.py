"""The F1 sheet: every key and the functions of the mouse, with a search."""

from __future__ import annotations

from collections.abc import Iterable

from imgui_bundle import ImVec2, imgui

from ui.panels.actions.action import BOOKMARKS, PLAY, TIME, WINDOW
from ui.panels.actions.table import ACTIONS
from ui.panels.picture.gestures import mouse_help
from ui.panels.pieces.widgets import text_wrapped_dim
from ui.panels.state import UiState
from ui.shell.finding.fuzzy import folded
from ui.style import theme


class HelpSheet:
    """Owns the text searched for."""

    def __init__(self) -> None:
        self._typed = ""

    def draw(self, ui: UiState) -> None:
        """Draw it while it is open."""
        if not ui.is_help_open:
            self._typed = ""
            return
        viewport = imgui.get_main_viewport()
        top = ImVec2(
            viewport.get_center().x, viewport.work_pos.y + 12
        )  # it stays there while a search makes it shorter
        imgui.set_next_window_pos(top, imgui.Cond_.always, ImVec2(0.5, 0.0))
        highest = viewport.work_size.y - 24
        imgui.set_next_window_size(ImVec2(880, 0), imgui.Cond_.always)
        imgui.set_next_window_size_constraints(ImVec2(880, 100), ImVec2(880, highest))  # in a low window it scrolls
        flags = imgui.WindowFlags_.no_docking | imgui.WindowFlags_.no_saved_settings | imgui.WindowFlags_.no_resize
        flags |= imgui.WindowFlags_.no_collapse
        imgui.push_style_var(imgui.StyleVar_.window_border_size, 1.0)
        imgui.push_style_color(imgui.Col_.window_bg, imgui.ImVec4(*theme.POPUP))
        is_shown, is_kept = imgui.begin("Keys and mouse", True, flags)
        imgui.pop_style_color()
        imgui.pop_style_var()
        if imgui.is_window_appearing():
            ui.redraw_within(0.0)  # only then does what lies below know that it is covered
        if is_shown:
            if imgui.is_window_appearing():
                imgui.set_keyboard_focus_here()
            imgui.set_next_item_width(-1)
            self._typed = imgui.input_text_with_hint("##search", "Find an action, a key or a gesture", self._typed)[1]
            ui.mark("help.search")
            groups = dict.fromkeys(action.group for action in ACTIONS)
            left = (TIME, PLAY, BOOKMARKS, WINDOW)
            if imgui.begin_table("sheet", 2, imgui.TableFlags_.sizing_stretch_same):
                imgui.table_next_column()
                for group in left:
                    _draw_group(group, self._found(_rows(group, ui)))
                _draw_group("Mouse", self._found(mouse_help(ui.navigation.preset)))
                imgui.table_next_column()
                for group in (group for group in groups if group not in left):
                    _draw_group(group, self._found(_rows(group, ui)))
                imgui.end_table()
            others = next(action for action in ACTIONS if action.id == "window.palette")
            key = ui.keys.label(others)
            text_wrapped_dim(f"Actions without a key are in the menus; {key} finds any action by name." if key else "")
        imgui.end()
        ui.is_help_open = bool(is_kept)

    def _found(self, rows: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
        """The rows that have every typed word in their keys or their text."""
        words = folded(self._typed).split()
        return [row for row in rows if all(word in folded(" ".join(row)) for word in words)]


def _rows(group: str, ui: UiState) -> list[tuple[str, str]]:
    """Keys and words of the actions of a group that have a key."""
    rows = ((", ".join(ui.keys.labels(action)), action) for action in ACTIONS if action.group == group)
    return [(label, action.text) for label, action in rows if label and action.is_in_help]


def _draw_group(title: str, rows: list[tuple[str, str]]) -> None:
    if not rows:
        return
    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*theme.SKY))
    imgui.separator_text(title)
    imgui.pop_style_color()
    key_width = max(imgui.calc_text_size(label).x for label, _ in rows) + 14
    if not imgui.begin_table(title, 2):
        return
    imgui.table_setup_column("key", imgui.TableColumnFlags_.width_fixed, key_width)
    imgui.table_setup_column("text")
    for label, text in rows:
        imgui.table_next_row()
        imgui.table_next_column()
        imgui.text(label)
        imgui.table_next_column()
        text_wrapped_dim(text)
    imgui.end_table()
