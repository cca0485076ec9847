"""Undo and redo as buttons with the step of each, whatever was edited."""

from __future__ import annotations

from imgui_bundle import imgui

from app.session.edit_status import HistoryStatus
from app.session.editing.edit_commands import Redo, Undo
from ui.panels.state import Dispatch, UiState
from ui.style.theme import Icon


def history_width() -> float:
    """Of the two buttons without words, units."""
    style = imgui.get_style()
    glyphs = imgui.calc_text_size(Icon.UNDO).x + imgui.calc_text_size(Icon.LOOP).x
    return glyphs + 4 * style.frame_padding.x + style.item_spacing.x


def draw_history(
    history: HistoryStatus, dispatch: Dispatch, ui: UiState, panel: str, *, has_words: bool = True
) -> None:
    """Two buttons in a row. panel: In front of their names in ui.rects."""
    imgui.begin_disabled(not history.undo)
    if imgui.button(f"{Icon.UNDO}  Undo" if has_words else f"{Icon.UNDO}##undo"):
        dispatch(Undo())
    ui.mark(f"{panel}.undo")
    imgui.end_disabled()
    imgui.set_item_tooltip(f"Undo: {history.undo or 'nothing'} (Ctrl+Z)")
    imgui.same_line()
    imgui.begin_disabled(not history.redo)
    if imgui.button(f"{Icon.LOOP}  Redo" if has_words else f"{Icon.LOOP}##redo"):
        dispatch(Redo())
    ui.mark(f"{panel}.redo")
    imgui.end_disabled()
    imgui.set_item_tooltip(f"Redo: {history.redo or 'nothing'} (Ctrl+Shift+Z or Ctrl+Y)")
