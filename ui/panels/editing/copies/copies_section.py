"""Copies of objects: making them, the list with its groups, and the chosen one in numbers."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby

from imgui_bundle import ImVec2, imgui

from app.session.duplicating.copy_commands import RemoveCopies, SwitchCopies
from app.session.session_view import SessionView
from engine.editing.copies.object_copy import Copies, ObjectCopy
from engine.editing.scene_object import SceneObject
from engine.text import one_line
from ui.panels.editing.copies.copy_details import draw_copy_details
from ui.panels.editing.copies.making_copies import duplicate, give_speed, make_crowd
from ui.panels.editing.fields import label_before, numbers, whole_numbers
from ui.panels.editing.panel.sections import section_header
from ui.panels.pieces.widgets import elided, text_wrapped_dim
from ui.panels.state import Dispatch, UiState
from ui.style.theme import Icon

BUTTON_WIDTH = 30.0
MOST_ROWS = 7.5
"""Of the list; the others are scrolled to."""
MOST_IN_ROW = 30
"""Of a crowd, either way; commands make larger ones."""


def draw_copies(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """The section; folded away until it is wanted."""
    if not section_header(ui, "copies", is_used=bool(session.edits.copies)):
        return
    found = ui.copies.object(session.edits)
    if found is None:
        text_wrapped_dim("Make an object first. A copy shows it once more, elsewhere, at another time or speed.")
        return
    imgui.begin_disabled(not session.edits.can_edit)
    _draw_making(session, dispatch, ui, found)
    _draw_list(session.edits.copies, dispatch, ui)
    copy = ui.copies.copy(session.edits)
    if copy is not None:
        imgui.separator()
        imgui.push_id(copy.copy_id)
        draw_copy_details(session, dispatch, ui, copy)
        imgui.pop_id()
    imgui.end_disabled()


def _draw_making(session: SessionView, dispatch: Dispatch, ui: UiState, found: SceneObject) -> None:
    tool = ui.copies
    label_before("Object")
    if imgui.begin_combo("##copied object", one_line(found.name)):
        for one in session.edits.objects:
            if imgui.selectable(f"{one_line(one.name)}##{one.object_id}", one is found)[0]:
                tool.object_id = one.object_id
            ui.mark(f"copies.object {one.object_id}")
        imgui.end_combo()
    else:
        ui.mark("copies.object")
    if imgui.button("Duplicate"):
        duplicate(session, dispatch, ui, found)
    ui.mark("copies.duplicate")
    imgui.set_item_tooltip("Shows the object once more, next to it")
    imgui.same_line()
    if imgui.button("Own speed"):
        give_speed(session, dispatch, ui, found)
    ui.mark("copies.speed")
    imgui.set_item_tooltip("Plays the object at another speed than the scene")
    size = whole_numbers(ui, "crowd", "Crowd", (tool.n_across, tool.n_along), low=1, high=MOST_IN_ROW)
    imgui.set_item_tooltip("How many stand in a row, and how many rows")
    if size is not None:
        tool.n_across, tool.n_along = size
    spacing = numbers(
        ui, "spacing", "Spacing", [tool.spacing], speed=0.02, low=0.1, high=100.0, text_format="%.2f widths"
    )
    tool.spacing = tool.spacing if spacing is None else spacing[0]
    step = numbers(
        ui, "step", "Step", [tool.step_frames], speed=0.1, low=-1e4, high=1e4, text_format="%.1f frames later"
    )
    tool.step_frames = tool.step_frames if step is None else step[0]
    imgui.begin_disabled(tool.n_across * tool.n_along < 2)
    if imgui.button("Make crowd"):
        make_crowd(session, dispatch, ui, found)
    ui.mark("copies.make crowd")
    imgui.end_disabled()
    imgui.set_item_tooltip("Fills rows with copies, each later than the one before")


def _draw_list(copies: Copies, dispatch: Dispatch, ui: UiState) -> None:
    if not copies:
        return
    rows = list(_rows(copies))
    height = min(len(rows) + 0.2, MOST_ROWS) * imgui.get_frame_height_with_spacing()
    if imgui.begin_child("copies", ImVec2(0, height)):
        clipper = imgui.ListClipper()
        clipper.begin(len(rows), imgui.get_frame_height_with_spacing())
        while clipper.step():
            for words, members in rows[clipper.display_start : clipper.display_end]:
                _draw_row(words, members, dispatch, ui)
    imgui.end_child()


def _rows(copies: Copies) -> Iterator[tuple[str, Copies]]:
    """A row for each group that has several copies, and for each copy."""
    for group, members in groupby(copies, lambda copy: copy.group):
        together = tuple(members)
        if group and len(together) > 1:
            yield group, together
        for copy in together:
            yield "", (copy,)


def _draw_row(group: str, members: Copies, dispatch: Dispatch, ui: UiState) -> None:
    first, ids = members[0], tuple(copy.copy_id for copy in members)
    name = f"group {first.copy_id}" if group else f"{first.copy_id}"
    is_on = any(copy.is_on for copy in members)
    imgui.push_id(name)
    if imgui.button(f"{Icon.EYE if is_on else ' – '}##on", ImVec2(BUTTON_WIDTH, 0)):
        dispatch(SwitchCopies(ids, not is_on))
    ui.mark(f"copies.on {name}")
    imgui.set_item_tooltip("Switch off" if is_on else "Switch on")
    imgui.same_line()
    room = imgui.get_content_region_avail().x - BUTTON_WIDTH - imgui.get_style().item_spacing.x
    words = f"{one_line(group)}: {len(members)} copies" if group else _copy_words(first)
    if imgui.selectable(elided(words, room), not group and ui.copies.chosen == first.copy_id, size=ImVec2(room, 0))[0]:
        ui.copies.chosen = None if group or ui.copies.chosen == first.copy_id else first.copy_id
    ui.mark(f"copies.row {name}")
    imgui.same_line()
    if imgui.button(f"{Icon.TRASH}##remove", ImVec2(BUTTON_WIDTH, 0)):
        dispatch(RemoveCopies(ids))
    ui.mark(f"copies.remove {name}")
    imgui.set_item_tooltip("Remove these copies" if group else "Remove this copy")
    imgui.pop_id()


def _copy_words(copy: ObjectCopy) -> str:
    words = [one_line(copy.name)]
    if copy.shift_frames:
        words.append(f"{copy.shift_frames:+g} frames")
    if copy.speed != 1.0:
        words.append(f"x {copy.speed:g}")
    return ", ".join(words)
