"""The target: what is selected or drawn now, in words and numbers, with undo and redo. It stays on top of the panel."""

from __future__ import annotations

from imgui_bundle import imgui

from app.document.changes.edit_words import edit_title
from app.session.session_view import SessionView
from engine.editing.edit import ObjectTarget
from engine.text import one_line
from ui.panels.editing.edit_subject import drawn_volume, invert_selection, meant
from ui.panels.pieces.history_buttons import draw_history, history_width
from ui.panels.pieces.widgets import elided
from ui.panels.state import Dispatch, UiState


def draw_target(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Two lines, whatever is selected, so that nothing below them moves."""
    if session.selection.is_busy:
        ui.redraw_within(0.1)
    target, note = _target_words(session, ui)
    room = imgui.get_content_region_avail().x
    _draw_elided(target, room, is_dim=False)
    ui.mark("selection.counts")
    imgui.align_text_to_frame_padding()
    start = imgui.get_cursor_pos_x()
    buttons = history_width()
    if drawn_volume(ui) is None:
        _draw_elided(note, room - buttons - 8, is_dim=True)
    else:
        if imgui.checkbox("Everything outside", ui.editing.is_outside)[0]:
            invert_selection(dispatch, ui)
        ui.mark("edits.outside")
        imgui.set_item_tooltip("Edits everything outside the drawn volume (Shift+I)")
    imgui.same_line(start + room - buttons)
    draw_history(session.history, dispatch, ui, "edits", has_words=False)


def _target_words(session: SessionView, ui: UiState) -> tuple[str, str]:
    """What new edits act on, and a remark on it."""
    status, (volume, words) = session.selection, meant(session, ui)
    if status.is_busy:
        return (words or "Nothing is selected"), "Selecting ..."
    if isinstance(volume, ObjectTarget):
        return words, "The chosen object"
    if volume is not None:
        return (f"All but {words}" if ui.editing.is_outside else f"In {words}"), ""
    if words:
        is_part = status.n_shown != status.n_gaussians
        return status.words, f"{status.n_shown:,} in this frame" if is_part else "Selected"
    edit = session.edits.edit(ui.editing.chosen)
    if edit is not None:
        return "Nothing is selected", f"Chosen: {one_line(edit_title(edit, session.edits.objects))}"
    return "Nothing is selected", "" if status.can_select else "No Gaussians in this frame yet"


def _draw_elided(words: str, width: float, *, is_dim: bool) -> None:
    """One line of words, all of them in its tooltip."""
    shown = elided(words, width)
    imgui.text_disabled(shown) if is_dim else imgui.text(shown)
    if shown != words:
        imgui.set_item_tooltip(words.replace("%", "%%"))
