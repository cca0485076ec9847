"""The panel of the history: every step by name, past and future; a click goes there."""

from __future__ import annotations

from imgui_bundle import ImVec4, imgui

from app.session.editing.edit_commands import GoToStep
from app.session.session_view import SessionView
from engine.text import one_line
from ui.panels.pieces.copying import draw_copy_entries
from ui.panels.pieces.history_buttons import draw_history
from ui.panels.pieces.widgets import elided, text_wrapped_dim
from ui.panels.state import Dispatch, Rect, UiState
from ui.style import theme


class HistoryPanel:
    """Draws the list; knows which step it has scrolled to."""

    def __init__(self) -> None:
        self._seen = -1

    def draw(self, session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        """The first step on top; undone steps follow the present one, paler."""
        if session.capture is None:
            text_wrapped_dim("Your steps appear here once a capture is open.")
            return
        history = session.history
        draw_history(history, dispatch, ui, "history")
        names, present = ("Start", *history.past, *history.future), len(history.past)
        if imgui.begin_child("steps"):
            line = imgui.get_text_line_height_with_spacing()
            clipper = imgui.ListClipper()
            clipper.begin(len(names), line)
            if present != self._seen:
                clipper.include_item_by_index(present)
            while clipper.step():
                for row in range(clipper.display_start, clipper.display_end):
                    is_seen = _draw_step(session, dispatch, ui, row, names[row], present)
                    if row == present != self._seen:
                        self._seen = present
                        if not is_seen:  # else what was clicked would move away from the pointer
                            imgui.set_scroll_here_y(0.5)
        imgui.end_child()


def _draw_step(session: SessionView, dispatch: Dispatch, ui: UiState, row: int, name: str, present: int) -> bool:
    """Whether it is in sight."""
    imgui.push_id(row)
    if imgui.selectable("##step", row == present)[0] and row != present:
        dispatch(GoToStep(row - present))
    if 0 < row <= present and imgui.begin_popup_context_item("menu"):
        draw_copy_entries(ui, "history.menu", lambda: session.command_texts.step(present - row))
        imgui.end_popup()
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    is_seen = imgui.is_item_visible()
    if is_seen:
        ui.mark_rect(f"history.step{row}", Rect(low.x, low.y, high.x, high.y))
    imgui.same_line(4)
    color = theme.TEXT if row <= present else theme.TEXT_DIM
    text = f"{row}  {one_line(name)}"
    imgui.push_style_color(imgui.Col_.text, ImVec4(*color))
    imgui.text(elided(text, imgui.get_content_region_avail().x))
    imgui.pop_style_color()
    imgui.pop_id()
    return is_seen
