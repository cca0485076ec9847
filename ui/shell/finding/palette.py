"""The palette: type a few letters of what you want, Enter does it. Draws over everything; what it offers is
ui.shell.finding.palette_entries' business.
"""

from __future__ import annotations

from imgui_bundle import ImVec2, ImVec4, imgui

from app.session.session_view import SessionView
from ui.panels.pieces.widgets import elided
from ui.panels.state import Dispatch, UiState
from ui.shell.finding.palette_entries import Found, PaletteEntry, entries, found
from ui.style import theme
from ui.style.theme import Icon

TITLE = "Find an action###palette"
WIDTH, HIGHEST = 640.0, 460.0
ROW_HEIGHT = 26.0
PAGE = 8
_FLAGS = (
    imgui.WindowFlags_.no_title_bar
    | imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.no_resize
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.no_nav_inputs  # the arrows, Enter and Escape are the list's
)


class ActionPalette:
    """Owns the typed text and the chosen row, as long as it is open."""

    def __init__(self) -> None:
        self._typed = ""
        self._chosen = 0
        self._offered: list[PaletteEntry] = []
        self._shown: list[Found] = []
        self._is_new = False
        self._is_scroll_wanted = False

    @property
    def shown(self) -> list[PaletteEntry]:
        """The listed entries, best first."""
        return [hit.entry for hit in self._shown]

    def draw(self, session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        """Open it where that was asked for, and draw it while it is open."""
        if ui.wishes.is_palette:
            ui.wishes.is_palette = False
            self._open(session, ui)
        viewport = imgui.get_main_viewport()
        width = min(WIDTH, viewport.work_size.x - 40)
        height = min(HIGHEST, viewport.work_size.y - 40)
        top = ImVec2(viewport.get_center().x, viewport.work_pos.y + min(60.0, (viewport.work_size.y - height) / 2))
        imgui.set_next_window_pos(top, imgui.Cond_.always, ImVec2(0.5, 0.0))
        imgui.set_next_window_size(ImVec2(width, height))
        if not imgui.begin_popup(TITLE, _FLAGS):
            return
        chosen = self._draw_inside(ui)
        if chosen is not None or imgui.is_key_pressed(imgui.Key.escape, False):
            imgui.close_current_popup()
            ui.redraw_within(0.0)
        imgui.end_popup()
        if chosen is not None:
            ui.preferences.note_used(chosen.id)
            chosen.run(session, dispatch, ui)

    def _open(self, session: SessionView, ui: UiState) -> None:
        self._typed, self._chosen, self._is_new = "", 0, True
        self._offered = entries(session, ui)
        self._find(ui)
        imgui.open_popup(TITLE)

    def _find(self, ui: UiState) -> None:
        self._shown = found(self._typed, self._offered, ui.preferences.used_actions)
        self._chosen, self._is_scroll_wanted = 0, True

    def _draw_inside(self, ui: UiState) -> PaletteEntry | None:
        """Returns the chosen entry."""
        if self._is_new:
            self._is_new = False
            imgui.set_keyboard_focus_here()
        imgui.set_next_item_width(-1)
        hint = "Type what you want to do: an action, a camera, a clip, a project"
        is_changed, self._typed = imgui.input_text_with_hint("##typed", hint, self._typed)
        ui.mark("palette.typed")
        if is_changed:
            self._find(ui)
        self._step_by_keys()
        is_agreed = imgui.is_key_pressed(imgui.Key.enter, False) or imgui.is_key_pressed(imgui.Key.keypad_enter, False)
        clicked = None
        if imgui.begin_child("rows", ImVec2(0, -24), imgui.ChildFlags_.none, imgui.WindowFlags_.no_nav_inputs):
            clicked = self._draw_rows(ui)
        imgui.end_child()
        self._draw_foot(ui)
        if is_agreed and self._shown:
            clicked = self._chosen
        if clicked is None:
            return None
        entry = self._shown[clicked].entry
        return None if entry.why_not else entry

    def _step_by_keys(self) -> None:
        key, last = imgui.Key, len(self._shown) - 1
        step = imgui.is_key_pressed(key.down_arrow) - imgui.is_key_pressed(key.up_arrow)
        page = PAGE * (imgui.is_key_pressed(key.page_down) - imgui.is_key_pressed(key.page_up))
        if last < 0 or not (step or page):
            return
        if step:
            self._chosen = (self._chosen + step) % (last + 1)
        self._chosen = min(max(self._chosen + page, 0), last)
        self._is_scroll_wanted = True

    def _draw_rows(self, ui: UiState) -> int | None:
        clicked = None
        if not self._shown:
            imgui.text_disabled("Nothing found.")
        clipper = imgui.ListClipper()
        clipper.begin(len(self._shown), ROW_HEIGHT + imgui.get_style().item_spacing.y)
        if self._shown:
            clipper.include_item_by_index(self._chosen)
        while clipper.step():
            for index in range(clipper.display_start, clipper.display_end):
                if self._draw_row(index, ui):
                    clicked = index
        clipper.end()
        return clicked

    def _draw_row(self, index: int, ui: UiState) -> bool:
        hit = self._shown[index]
        entry, is_chosen = hit.entry, index == self._chosen
        imgui.push_id(index)
        start = imgui.get_cursor_screen_pos()
        width = imgui.get_content_region_avail().x
        flags = imgui.SelectableFlags_.no_auto_close_popups
        is_clicked = imgui.selectable("##row", is_chosen, flags, ImVec2(width, ROW_HEIGHT))[0]
        ui.mark(f"palette.row{index}")
        if imgui.is_item_hovered() and entry.why_not:
            imgui.set_tooltip(entry.why_not)
        if is_chosen and self._is_scroll_wanted:
            self._is_scroll_wanted = False
            imgui.set_scroll_here_y(0.5)
        imgui.pop_id()
        draw, y = imgui.get_window_draw_list(), start.y + 5
        if is_chosen:
            draw.add_rect_filled(start, ImVec2(start.x + 3, start.y + ROW_HEIGHT), theme.u32(theme.SKY))
        right = start.x + width - 8
        for words, color in ((entry.keys, theme.TEXT), (entry.group, theme.TEXT_DIM)):
            if words:
                right -= imgui.calc_text_size(words).x
                draw.add_text(ImVec2(right, y), theme.u32(theme.TEXT_DIM if entry.why_not else color), words)
                right -= 16
        x = start.x + 8
        text = elided(entry.text, right - x)
        draw.add_text(ImVec2(x, y), theme.u32(theme.TEXT_DIM if entry.why_not else theme.TEXT), text)
        self._mark_letters(draw, text, hit.positions, ImVec2(x, y))
        return is_clicked

    def _mark_letters(self, draw: imgui.ImDrawList, text: str, positions: tuple[int, ...], at: ImVec2) -> None:
        """A line below each letter that was meant: colour alone is not enough."""
        bottom = at.y + imgui.get_text_line_height() + 1
        for position in positions:
            if position < len(text):
                left = at.x + imgui.calc_text_size(text[:position]).x
                right = at.x + imgui.calc_text_size(text[: position + 1]).x
                draw.add_line(ImVec2(left, bottom), ImVec2(right, bottom), theme.u32(theme.SKY), 2.0)

    def _draw_foot(self, ui: UiState) -> None:
        entry = self._shown[self._chosen].entry if self._shown else None
        if entry is not None and entry.why_not:
            imgui.text_colored(ImVec4(*theme.ORANGE), f"{Icon.WARNING}  {entry.why_not}")
            ui.mark("palette.why_not")
        else:
            imgui.text_disabled("Up and Down choose, Enter runs, Escape closes")
