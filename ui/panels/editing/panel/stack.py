"""The stack of edits in the panel, the last one on top."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.document.changes.edit_words import edit_title, target_text
from app.document.changes.reach_words import acting_text, reach_note
from app.session.clips.clip_commands import ApplyDeletions
from app.session.editing.edit_commands import DuplicateEdit, MoveEdit, RemoveEdit, ToggleEdit
from app.session.session_view import SessionView
from engine.editing.actions import Delete
from engine.editing.edit import Edit
from engine.text import one_line
from ui.panels.editing.panel.sections import reach_section
from ui.panels.pieces.copying import draw_copy_entries
from ui.panels.pieces.widgets import elided, text_wrapped_dim
from ui.panels.state import Dispatch, UiState
from ui.style import theme
from ui.style.theme import Icon

ROW_HEIGHT, BUTTON_WIDTH = 42.0, 30.0
LEAST_ROWS, MOST_ROWS = 1.2, 6.2
PAYLOAD = "edit"


def draw_stack(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """One row per edit, the last one on top: it acts on what the others have left."""
    imgui.separator_text("Edits")
    reach_section(ui, "edits")
    edits = session.edits.edits
    if not edits:
        text_wrapped_dim("No edits: everything is shown as the clips have it.")
        return
    n_on = sum(edit.is_on for edit in edits)
    imgui.text(f"{len(edits)} edit{'' if len(edits) == 1 else 's'}")
    if n_on < len(edits):
        imgui.same_line()
        imgui.text_disabled(f"{len(edits) - n_on} off")
    n_rows = min(max(len(edits) + 0.2, LEAST_ROWS), MOST_ROWS)
    if imgui.begin_child("stack", ImVec2(0, n_rows * (ROW_HEIGHT + imgui.get_style().item_spacing.y))):
        clipper = imgui.ListClipper()
        clipper.begin(len(edits), ROW_HEIGHT + imgui.get_style().item_spacing.y)
        while clipper.step():
            for row in range(clipper.display_start, clipper.display_end):
                position = len(edits) - 1 - row
                imgui.push_id(edits[position].edit_id)
                _draw_row(session, dispatch, ui, edits[position], position)
                imgui.pop_id()
    imgui.end_child()
    is_deleting = any(edit.is_on and isinstance(edit.action, Delete) for edit in edits)
    imgui.begin_disabled(not (session.edits.can_edit and is_deleting))
    if imgui.button("Apply permanently ..."):
        dispatch(ApplyDeletions())
    ui.mark("edits.apply")
    imgui.end_disabled()
    imgui.set_item_tooltip("Permanently removes deleted anchors from the clip files, after you confirm")


def _draw_row(session: SessionView, dispatch: Dispatch, ui: UiState, edit: Edit, position: int) -> None:
    is_chosen, start = ui.editing.chosen == edit.edit_id, imgui.get_cursor_screen_pos()
    flags = imgui.SelectableFlags_.allow_overlap
    if imgui.selectable("##edit", is_chosen, flags, ImVec2(0, ROW_HEIGHT))[0]:
        ui.editing.choose(None if is_chosen else edit.edit_id)
        ui.editing.is_row_clicked = True
    ui.mark(f"edits.row{edit.edit_id}")
    _drag_row(session, dispatch, edit, position)
    if imgui.begin_popup_context_item("menu"):
        _draw_menu(session, dispatch, ui, edit, position)
        imgui.end_popup()
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    draw = imgui.get_window_draw_list()
    x, room = low.x + BUTTON_WIDTH + 6, high.x - low.x - 2 * BUTTON_WIDTH - 14
    color = theme.TEXT if edit.is_on else theme.TEXT_DIM
    title = one_line(edit_title(edit, session.edits.objects))
    shown = elided(title, room)
    draw.add_text(ImVec2(x, low.y + 3), theme.u32(color), shown)
    reach = session.edits.reach(edit.edit_id)
    words = acting_text(edit.scope, reach, session.timeline.clips)
    if edit.name:
        words = f"{target_text(edit.target, session.edits.objects, is_inverted=edit.is_inverted)}, {words}"
    words = words if edit.is_on else f"off, {words}"
    lost = next((one for one in session.edits.lost if one.edit_id == edit.edit_id), None)
    if lost is not None:
        left = "the selection is gone" if lost.is_all else "part of the selection is gone"
        words = f"{Icon.WARNING}  {left}, {words}"
    elif reach_note(reach, edit.scope):
        words = f"{Icon.WARNING}  {words}"
    is_calm = lost is None and not reach_note(reach, edit.scope)
    draw.add_text(ImVec2(x, low.y + 22), theme.u32(theme.TEXT_DIM if is_calm else theme.ORANGE), elided(words, room))
    imgui.set_cursor_screen_pos(ImVec2(low.x + 2, low.y + 8))
    imgui.begin_disabled(not session.edits.can_edit)
    if imgui.button(f"{Icon.EYE if edit.is_on else ' – '}##on", ImVec2(BUTTON_WIDTH, 26)):
        dispatch(ToggleEdit(edit.edit_id))
    ui.mark(f"edits.on{edit.edit_id}")
    imgui.set_item_tooltip("Switch off" if edit.is_on else "Switch on")
    imgui.set_cursor_screen_pos(ImVec2(high.x - BUTTON_WIDTH - 2, low.y + 8))
    if imgui.button(f"{Icon.TRASH}##remove", ImVec2(BUTTON_WIDTH, 26)):
        dispatch(RemoveEdit(edit.edit_id))
    ui.mark(f"edits.remove{edit.edit_id}")
    imgui.set_item_tooltip("Remove this edit; the others stay")
    imgui.end_disabled()
    imgui.set_cursor_screen_pos(ImVec2(start.x, start.y + ROW_HEIGHT))
    imgui.dummy(ImVec2(0, 0))


def _drag_row(session: SessionView, dispatch: Dispatch, edit: Edit, position: int) -> None:
    """A row that is dragged onto another one takes its place."""
    if not session.edits.can_edit:
        return
    if imgui.begin_drag_drop_source(imgui.DragDropFlags_.source_no_preview_tooltip):
        imgui.set_drag_drop_payload_py_id(PAYLOAD, edit.edit_id)
        imgui.end_drag_drop_source()
    if imgui.begin_drag_drop_target():
        payload = imgui.accept_drag_drop_payload_py_id(PAYLOAD)
        if payload is not None and payload.data_id != edit.edit_id:
            dispatch(MoveEdit(payload.data_id, position))
        imgui.end_drag_drop_target()


def _draw_menu(session: SessionView, dispatch: Dispatch, ui: UiState, edit: Edit, position: int) -> None:
    can_edit, n_edits = session.edits.can_edit, len(session.edits.edits)
    for label, command, is_possible in (
        ("Switch off" if edit.is_on else "Switch on", ToggleEdit(edit.edit_id), True),
        ("Duplicate", DuplicateEdit(edit.edit_id), True),
        ("Later: move up", MoveEdit(edit.edit_id, position + 1), position + 1 < n_edits),
        ("Earlier: move down", MoveEdit(edit.edit_id, position - 1), position > 0),
        ("Remove", RemoveEdit(edit.edit_id), True),
    ):
        if imgui.menu_item(label, "", False, can_edit and is_possible)[0]:
            dispatch(command)
        ui.mark(f"edits.menu {label.split(':')[0].lower()}")
    imgui.separator()
    draw_copy_entries(ui, "edits.menu", lambda: session.command_texts.edit(edit.edit_id))
