"""The details of one edit in numbers: its name, where it holds, its target and its action."""

from __future__ import annotations

from typing import Any

from imgui_bundle import imgui
from msgspec import structs

from app.document.changes.edit_words import edit_title, scope_text, target_text
from app.document.changes.fill_words import fill_text
from app.document.changes.reach_words import reach_note
from app.session.editing.edit_commands import ChangeEdit, FillBehind, RenameEdit
from app.session.editing.scope_choice import SCOPE_CHOICES, SCOPE_WORDS, choice_of, chosen_scope, extent_text
from app.session.session_view import SessionView
from engine.editing.actions import Action, Delete, Hide, Transform, Vector, vector_of
from engine.editing.edit import MAX_NAME_CHARACTERS, Box, Edit, Prism, Scope, Sphere, Volume
from engine.editing.volumes.keyed_volume import volume_of, with_volume
from engine.setting import Setting, settings_of
from engine.text import one_line
from ui.panels.editing.fields import label_before, numbers, turn_fields, whole_numbers
from ui.panels.editing.volume_keys import draw_volume_keys
from ui.panels.pieces.widgets import elided, segment, text_warning, text_wrapped_dim
from ui.panels.state import Dispatch, UiState

FAR = 1e6
"""Largest coordinate that fields take, scene units."""
LEAST_SIZE = 1e-6
TITLE_MARGIN = 24.0
"""Of the line beside a title, units."""
SPEED_SHARE = 2e-3
"""Of a drag over a field, per unit: as a share of the size of the changed thing."""


def draw_chosen(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """The chosen edit in numbers. Where one was just made, what it does comes into sight; a row of the stack below that
    was clicked stays under the pointer."""
    edit, top = session.edits.edit(ui.editing.chosen), imgui.get_cursor_pos_y()
    end_of_action = top if edit is None else _draw_fields(session, dispatch, ui, edit)
    height, tool, scroll = imgui.get_cursor_pos_y() - top, ui.editing, imgui.get_scroll_y()
    grown, tool.details_height = height - tool.details_height, height
    wanted = scroll
    if tool.is_new and end_of_action > scroll + imgui.get_window_height():
        wanted = min(top, end_of_action - imgui.get_window_height())
    elif tool.is_row_clicked:
        wanted = scroll + grown if edit is None else min(scroll + grown, top)
    tool.is_new = tool.is_row_clicked = False
    if wanted != scroll:
        imgui.set_scroll_y(wanted)
        ui.redraw_within(0.0)  # the panel scrolls in the next frame


def _draw_fields(session: SessionView, dispatch: Dispatch, ui: UiState, edit: Edit) -> float:
    """Where the fields of its action end, from the top of the panel, units."""
    title = one_line(edit_title(edit, session.edits.objects))
    imgui.separator_text(elided(title, imgui.get_content_region_avail().x - 2 * TITLE_MARGIN))
    imgui.begin_disabled(not session.edits.can_edit)
    imgui.push_id(edit.edit_id)
    # First what the edit does, for which it was just made, then the rest.
    action = _draw_action(session, ui, edit.action)
    if action is not None:
        dispatch(ChangeEdit(structs.replace(edit, action=action), ui.editing.gesture, "change"))
    end_of_action = imgui.get_cursor_pos_y()
    _draw_rest(session, dispatch, ui, edit)
    imgui.pop_id()
    imgui.end_disabled()
    return end_of_action


def _draw_rest(session: SessionView, dispatch: Dispatch, ui: UiState, edit: Edit) -> None:
    frame = session.timeline.frame_index
    volume = volume_of(edit.target, frame)
    both = isinstance(edit.action, Transform) and volume is not None
    if both:
        imgui.text_disabled("Handles")
        for is_shape, words in ((False, "the movement"), (True, "the shape")):
            imgui.same_line()
            if segment(words, ui.editing.is_shape_meant == is_shape):
                ui.editing.is_shape_meant = is_shape
            ui.mark(f"edits.handles {'shape' if is_shape else 'movement'}")
    if volume is None:
        text_wrapped_dim(f"Acts on {target_text(edit.target, session.edits.objects)}.")
    else:
        changed = _draw_volume(ui, volume)
        if changed is not None:
            target = with_volume(edit.target, frame, changed)
            dispatch(ChangeEdit(structs.replace(edit, target=target), ui.editing.gesture, "change"))
    _draw_scope(session, dispatch, ui, edit)
    is_clicked, is_inverted = imgui.checkbox("Acts on everything else", edit.is_inverted)
    ui.mark("edits.inverted")
    if is_clicked:
        dispatch(ChangeEdit(structs.replace(edit, is_inverted=is_inverted), verb="invert"))
    if volume is not None:
        draw_volume_keys(session, dispatch, ui, edit)
    _draw_name(session, dispatch, ui, edit)
    if isinstance(edit.action, Delete | Hide):
        _draw_fill(session, dispatch, ui, edit)


def _draw_fill(session: SessionView, dispatch: Dispatch, ui: UiState, edit: Edit) -> None:
    """The fill of an edit that takes something away: its figures, and the way to make it or to remove it."""
    imgui.begin_disabled(not session.edits.can_edit)
    if imgui.button("Fill behind"):
        dispatch(FillBehind(edit.edit_id))
    imgui.end_disabled()
    ui.mark("edits.fill")
    imgui.set_item_tooltip("Continue the room behind it where no camera saw it, and take traces of it away")
    if edit.fill is None:
        return
    imgui.same_line()
    if imgui.button("Remove fill"):
        dispatch(ChangeEdit(structs.replace(edit, fill=None), verb="remove fill"))
    ui.mark("edits.remove_fill")
    text = fill_text(edit)
    text_wrapped_dim(f"{text[0].upper()}{text[1:]}. The view mode Birth clip shows where.")


def _draw_name(session: SessionView, dispatch: Dispatch, ui: UiState, edit: Edit) -> None:
    label_before("Name")
    shown = one_line(edit.name) if ui.editing.renamed is None else ui.editing.renamed
    flags = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all
    is_entered, typed = imgui.input_text_with_hint(
        "##edit name", one_line(edit_title(edit, session.edits.objects)), shown, flags
    )
    ui.mark("edits.name")
    ui.editing.renamed = typed if imgui.is_item_active() or is_entered else ui.editing.renamed
    if is_entered or imgui.is_item_deactivated_after_edit():
        ui.editing.renamed = None
        dispatch(RenameEdit(edit.edit_id, typed[:MAX_NAME_CHARACTERS]))
    elif not imgui.is_item_active():
        ui.editing.renamed = None


def _draw_scope(session: SessionView, dispatch: Dispatch, ui: UiState, edit: Edit) -> None:
    timeline, scope = session.timeline, edit.scope
    label_before("Scope")
    if imgui.begin_combo("##scope", scope_text(scope, timeline.clips)):
        present = choice_of(scope, timeline)
        for choice in SCOPE_CHOICES:
            wanted = chosen_scope(choice, timeline)
            words, frames = SCOPE_WORDS[choice], scope_text(wanted, timeline.clips)
            words = words if frames == words else f"{words}: {frames}"
            if imgui.selectable(words, choice == present)[0] and wanted != scope:
                dispatch(ChangeEdit(structs.replace(edit, scope=wanted), verb="scope"))
            ui.mark(f"edits.choose {choice}")
        imgui.end_combo()
    else:
        ui.mark("edits.scope")
        imgui.set_item_tooltip(extent_text(scope, timeline))
    if note := reach_note(session.edits.reach(edit.edit_id), scope):
        text_warning(note)
        ui.mark("edits.reach")
    if scope.stop is not None:
        frames = (scope.first, scope.stop - 1)
        found = whole_numbers(ui, "frames", "Frames", frames, low=0, high=timeline.last_frame)
        if found is not None:
            first, last = (found[0], max(found)) if found[0] != frames[0] else (min(found), found[1])
            wanted = Scope(min(first, last), max(first, last) + 1, scope.is_reference_only)
            dispatch(ChangeEdit(structs.replace(edit, scope=wanted), ui.editing.gesture, "scope"))


# Every field is drawn, whichever was changed: with fewer the panel would be lower for a moment, and scroll.


def _draw_volume(ui: UiState, volume: Volume) -> Volume | None:
    """Numbers of the volume that an edit acts on; what they were changed to."""
    changed = volume
    match volume:
        case (
            Box(center=center, half_sizes=half_sizes, quat=quat)
            | Prism(center=center, half_sizes=half_sizes, quat=quat)
        ):
            speed = SPEED_SHARE * max(half_sizes)
            found = numbers(ui, "center", "Centre", center, speed=speed, low=-FAR, high=FAR)
            if found is not None:
                changed = structs.replace(changed, center=vector_of(found))
            sizes = tuple(2.0 * half for half in half_sizes)
            found = numbers(ui, "size", "Size", sizes, speed=speed, low=LEAST_SIZE, high=FAR)
            if found is not None:
                changed = structs.replace(changed, half_sizes=vector_of([value / 2.0 for value in found]))
            turned = turn_fields(ui, "box turn", quat)
            if turned is not None:
                changed = structs.replace(changed, quat=turned)
        case Sphere(center=center, radius=radius):
            speed = SPEED_SHARE * radius
            found = numbers(ui, "center", "Centre", center, speed=speed, low=-FAR, high=FAR)
            if found is not None:
                changed = structs.replace(changed, center=vector_of(found))
            found = numbers(ui, "radius", "Radius", [radius], speed=speed, low=LEAST_SIZE, high=FAR)
            if found is not None:
                changed = structs.replace(changed, radius=found[0])
    return None if changed is volume else changed


def _draw_action(session: SessionView, ui: UiState, action: Action) -> Action | None:
    """Fields of an edit's action; the changed action."""
    changed = action
    for one in settings_of(type(action)).values():
        found = _field(ui, one, getattr(action, one.name), session.timeline.last_frame)
        imgui.set_item_tooltip(one.meaning)
        if found is not None:
            changed = changed.changed(one.name, found)
    return None if changed is action else changed


def _field(ui: UiState, one: Setting, value: Any, last_frame: int) -> Any:
    """A field as its type and range want it; its value once it was changed, else None."""
    if one.choices:
        return _choice_field(ui, one, value)
    if one.kind is tuple and len(value) == 4:
        return turn_fields(ui, one.name, value, one.label)
    low, high = one.offered or one.bounds or (-FAR, FAR)
    if one.kind is tuple and (low, high) == (0, 1):
        return _color_field(ui, one, value)
    if one.kind is int:
        last = last_frame if one.names == "frames" else int(high)
        whole = whole_numbers(ui, one.name, one.label, [value], low=int(low), high=last)
        return None if whole is None else whole[0]
    text_format = f"%{'+' if low < 0 else ''}.2f {one.unit}" if one.unit else "%.3f"
    parts = value if one.kind is tuple else [value]
    found = numbers(ui, one.name, one.label, parts, speed=one.step, low=low, high=high, text_format=text_format)
    return found[0] if found is not None and one.kind is not tuple else found


def _choice_field(ui: UiState, one: Setting, value: str) -> str | None:
    label_before(one.label)
    names = list(one.choices)
    is_changed, place = imgui.combo(f"##{one.name}", names.index(value), [one.titles.get(name, name) for name in names])
    ui.mark(f"edits.{one.name}")
    if is_changed:
        ui.editing.begin_gesture()
    return names[place] if is_changed else None


def _color_field(ui: UiState, one: Setting, value: Vector) -> Vector | None:
    label_before(one.label)
    is_changed, color = imgui.color_edit3(f"##{one.name}", list(value))
    ui.mark(f"edits.{one.name}")
    if imgui.is_item_activated():
        ui.editing.begin_gesture()
    return vector_of([min(max(part, 0.0), 1.0) for part in color]) if is_changed else None
