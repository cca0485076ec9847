"""The details of one edit in numbers: its name, where it holds, what it acts on and what it does."""

from __future__ import annotations

import numpy as np
from imgui_bundle import imgui
from msgspec import structs

from app.document.edit_words import edit_title, scope_text, target_text
from app.session.editing.edit_commands import ChangeEdit, RenameEdit
from app.session.editing.scope_choice import SCOPE_CHOICES, SCOPE_WORDS, choice_of, chosen_scope, reach_text
from engine.camera.rotations import quats_of_turns, turns_of_quats
from engine.editing.edit import (
    MAX_NAME_CHARACTERS,
    MAX_STOPS,
    Action,
    Box,
    Edit,
    Expose,
    Hold,
    Quat,
    Recolor,
    Scope,
    Smooth,
    Sphere,
    Target,
    Transform,
    Vector,
)
from engine.text import one_line
from ui.panels.editing.fields import label_before, numbers, whole_numbers
from ui.panels.editing.making import MakingNeeds
from ui.panels.state import Dispatch, UiState
from ui.panels.widgets import segment, text_wrapped_dim

FAR = 1e6
"""Largest coordinate that fields take, scene units."""
LEAST_SIZE = 1e-6
SPEED_SHARE = 2e-3
"""Of a drag over a field, per unit: as a share of the size of what is changed."""


def draw_details(session: MakingNeeds, dispatch: Dispatch, ui: UiState, edit: Edit) -> None:
    """Fields of the chosen edit."""
    _draw_name(dispatch, ui, edit)
    _draw_scope(session, dispatch, ui, edit)
    is_clicked, is_inverted = imgui.checkbox("Acts on everything else", edit.is_inverted)
    ui.mark("edits.inverted")
    if is_clicked:
        dispatch(ChangeEdit(structs.replace(edit, is_inverted=is_inverted), verb="invert"))
    both = isinstance(edit.action, Transform) and isinstance(edit.target, Box | Sphere)
    if both:
        imgui.text_disabled("Handles of")
        for is_shape, words in ((False, "the movement"), (True, "the shape")):
            imgui.same_line()
            if segment(words, ui.editing.is_shape_meant == is_shape):
                ui.editing.is_shape_meant = is_shape
            ui.mark(f"edits.handles {'shape' if is_shape else 'movement'}")
    target = _draw_target(ui, edit.target)
    if target is not None:
        dispatch(ChangeEdit(structs.replace(edit, target=target), ui.editing.gesture, "change"))
    action = _draw_action(session, ui, edit.action)
    if action is not None:
        dispatch(ChangeEdit(structs.replace(edit, action=action), ui.editing.gesture, "change"))


def _draw_name(dispatch: Dispatch, ui: UiState, edit: Edit) -> None:
    label_before("Name")
    shown = one_line(edit.name) if ui.editing.renamed is None else ui.editing.renamed
    flags = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all
    is_entered, typed = imgui.input_text_with_hint("##edit name", one_line(edit_title(edit)), shown, flags)
    ui.mark("edits.name")
    ui.editing.renamed = typed if imgui.is_item_active() or is_entered else ui.editing.renamed
    if is_entered or imgui.is_item_deactivated_after_edit():
        ui.editing.renamed = None
        dispatch(RenameEdit(edit.edit_id, typed[:MAX_NAME_CHARACTERS]))
    elif not imgui.is_item_active():
        ui.editing.renamed = None


def _draw_scope(session: MakingNeeds, dispatch: Dispatch, ui: UiState, edit: Edit) -> None:
    timeline, scope = session.timeline, edit.scope
    label_before("Holds")
    if imgui.begin_combo("##scope", scope_text(scope, timeline.clips)):
        present = choice_of(scope, timeline)
        for choice in SCOPE_CHOICES:
            wanted = chosen_scope(choice, timeline)
            words = f"{SCOPE_WORDS[choice]}: {scope_text(wanted, timeline.clips)}"
            if imgui.selectable(words, choice == present)[0] and wanted != scope:
                dispatch(ChangeEdit(structs.replace(edit, scope=wanted), verb="scope"))
            ui.mark(f"edits.choose {choice}")
        imgui.end_combo()
    else:
        ui.mark("edits.scope")
        imgui.set_item_tooltip(reach_text(scope, timeline))
    if scope.stop is not None:
        frames = (scope.first, scope.stop - 1)
        found = whole_numbers(ui, "frames", "Frames", frames, low=0, high=timeline.last_frame)
        if found is not None:
            first, last = (found[0], max(found)) if found[0] != frames[0] else (min(found), found[1])
            wanted = Scope(min(first, last), max(first, last) + 1, scope.is_reference_only)
            dispatch(ChangeEdit(structs.replace(edit, scope=wanted), ui.editing.gesture, "scope"))


def _draw_target(ui: UiState, target: Target) -> Target | None:
    """Numbers of what an edit acts on; what they were changed to."""
    match target:
        case Box(center=center, half_sizes=half_sizes, quat=quat):
            speed = SPEED_SHARE * max(half_sizes)
            found = numbers(ui, "center", "Centre", center, speed=speed, low=-FAR, high=FAR)
            if found is not None:
                return structs.replace(target, center=_vector(found))
            sizes = tuple(2.0 * half for half in half_sizes)
            found = numbers(ui, "size", "Size", sizes, speed=speed, low=LEAST_SIZE, high=FAR)
            if found is not None:
                return structs.replace(target, half_sizes=_vector([value / 2.0 for value in found]))
            turned = _turn_fields(ui, "box turn", quat)
            return None if turned is None else structs.replace(target, quat=turned)
        case Sphere(center=center, radius=radius):
            speed = SPEED_SHARE * radius
            found = numbers(ui, "center", "Centre", center, speed=speed, low=-FAR, high=FAR)
            if found is not None:
                return structs.replace(target, center=_vector(found))
            found = numbers(ui, "radius", "Radius", [radius], speed=speed, low=LEAST_SIZE, high=FAR)
            return None if found is None else structs.replace(target, radius=found[0])
    text_wrapped_dim(f"Acts on {target_text(target)}.")
    return None


def _draw_action(session: MakingNeeds, ui: UiState, action: Action) -> Action | None:
    """Numbers of what an edit does; what they were changed to."""
    match action:
        case Transform():
            return _draw_transform(ui, action)
        case Recolor():
            return _draw_recolor(ui, action)
        case Expose(stops=stops):
            found = numbers(
                ui, "stops", "Exposure", [stops], speed=0.01, low=-MAX_STOPS, high=MAX_STOPS, text_format="%+.2f EV"
            )
            return None if found is None else Expose(found[0])
        case Hold(frame_index=frame_index):
            last = session.timeline.last_frame
            whole = whole_numbers(ui, "hold", "As in frame", [frame_index], low=0, high=last)
            return None if whole is None else Hold(whole[0])
        case Smooth(sigma_frames=sigma_frames):
            found = numbers(
                ui, "sigma", "Over", [sigma_frames], speed=0.02, low=0.1, high=100.0, text_format="%.2f frames"
            )
            return None if found is None else Smooth(found[0])
    return None


def _draw_transform(ui: UiState, action: Transform) -> Transform | None:
    speed = 2e-3
    found = numbers(ui, "translation", "Moved by", action.translation, speed=speed, low=-FAR, high=FAR)
    if found is not None:
        return structs.replace(action, translation=_vector(found))
    turned = _turn_fields(ui, "turn", action.quat)
    if turned is not None:
        return structs.replace(action, quat=turned)
    found = numbers(ui, "scale", "Scaled by", [action.scale], speed=0.005, low=0.01, high=100.0)
    if found is not None:
        return structs.replace(action, scale=found[0])
    found = numbers(ui, "pivot", "About", action.pivot, speed=speed, low=-FAR, high=FAR)
    return None if found is None else structs.replace(action, pivot=_vector(found))


def _draw_recolor(ui: UiState, action: Recolor) -> Recolor | None:
    label_before("Tint")
    is_changed, tint = imgui.color_edit3("##tint", list(action.tint))
    ui.mark("edits.tint")
    if imgui.is_item_activated():
        ui.editing.begin_gesture()
    if is_changed:
        share = action.tint_share or 0.5  # else nothing would be seen of it
        return structs.replace(action, tint=_vector([min(max(value, 0.0), 1.0) for value in tint]), tint_share=share)
    for name, label, high in (
        ("tint_share", "Tint share", 1.0),
        ("saturation", "Saturation", 4.0),
        ("opacity", "Opacity", 4.0),
    ):
        found = numbers(ui, name, label, [getattr(action, name)], speed=0.005, low=0.0, high=high)
        if found is not None:
            return structs.replace(action, **{name: found[0]})
    found = numbers(ui, "gains", "Gains", action.gains, speed=0.005, low=0.0, high=10.0)
    return None if found is None else structs.replace(action, gains=_vector(found))


def _turn_fields(ui: UiState, name: str, quat: Quat) -> Quat | None:
    """A rotation as degrees about the axes of the scene."""
    degrees = tuple(float(value) for value in np.degrees(turns_of_quats(np.array(quat))))
    found = numbers(ui, name, "Turned by", degrees, speed=0.25, low=-180.0, high=180.0, text_format="%.1f°")
    if found is None:
        return None
    w, x, y, z = (float(value) for value in quats_of_turns(np.radians(found)))
    return w, x, y, z


def _vector(values: tuple[float, ...] | list[float]) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
