"""The chosen copy in numbers: its place, its time and what carries it. A drag in a field is one step of the history."""

from __future__ import annotations

from typing import Any, get_args

from imgui_bundle import imgui
from msgspec import structs

from app.session.duplicating.copy_commands import ChangeCopy
from app.session.session_view import SessionView
from engine.editing.copies.object_copy import MAX_SPEED, ObjectCopy, OnObject, OnPath, Outside
from engine.text import one_line
from ui.panels.editing.fields import label_before, numbers, turn_fields
from ui.panels.state import Dispatch, UiState

FAR = 1e6
"""Largest coordinate that fields take, scene units."""
SCALES = (1e-2, 1e2)
MOST_FRAMES = 1e5
OUTSIDE_WORDS: dict[Outside, str] = {"hold": "stands still", "loop": "begins again", "gone": "is gone"}


def draw_copy_details(session: SessionView, dispatch: Dispatch, ui: UiState, copy: ObjectCopy) -> None:
    """Fields of a copy."""
    changed = _outside_field(ui, _time_fields(ui, _place_fields(ui, copy)))
    changed = _carrier_field(session, ui, changed)
    is_clicked, is_in_place = imgui.checkbox("In the place of the object", copy.is_in_place)
    ui.mark("copies.in place")
    imgui.set_item_tooltip("Hides the object itself while the copy is there")
    if is_clicked:
        ui.editing.begin_gesture()
        changed = structs.replace(changed, is_in_place=is_in_place)
    if changed is not copy:
        dispatch(ChangeCopy(changed, ui.editing.gesture))


# Every field is drawn, whichever was changed: with fewer the panel would be lower for a moment, and scroll.


def _place_fields(ui: UiState, copy: ObjectCopy) -> ObjectCopy:
    place, values = copy.transform, {}
    found = numbers(ui, "copy move", "Move by", place.translation, speed=2e-3, low=-FAR, high=FAR)
    if found is not None:
        values["translation"] = found
    turned = turn_fields(ui, "copy turn", place.quat)
    if turned is not None:
        values["quat"] = turned
    scaled = numbers(ui, "copy scale", "Scale", [place.scale], speed=5e-3, low=SCALES[0], high=SCALES[1])
    if scaled is not None:
        values["scale"] = scaled[0]
    return structs.replace(copy, transform=structs.replace(place, **values)) if values else copy


def _time_fields(ui: UiState, copy: ObjectCopy) -> ObjectCopy:
    values: dict[str, Any] = {}
    for name, label, low, high, speed, text_format, tip in (
        ("shift_frames", "Later by", -MOST_FRAMES, MOST_FRAMES, 0.1, "%.1f frames", "Earlier where negative"),
        ("speed", "Speed", -MAX_SPEED, MAX_SPEED, 5e-3, "%.2f", "Backward where negative; 0 stands still"),
        (
            "anchor_frame",
            "From frame",
            0.0,
            MOST_FRAMES,
            0.1,
            "%.1f",
            "Where speed begins to count, and what carries it",
        ),
    ):
        found = numbers(
            ui, f"copy {name}", label, [getattr(copy, name)], speed=speed, low=low, high=high, text_format=text_format
        )
        imgui.set_item_tooltip(tip)
        if found is not None:
            values[name] = found[0]
    return structs.replace(copy, **values) if values else copy


def _outside_field(ui: UiState, copy: ObjectCopy) -> ObjectCopy:
    label_before("Outside")
    names = get_args(Outside)
    is_changed, place = imgui.combo("##outside", names.index(copy.outside), [OUTSIDE_WORDS[name] for name in names])
    ui.mark("copies.outside")
    imgui.set_item_tooltip("What the copy does when its object does not exist")
    if not is_changed:
        return copy
    ui.editing.begin_gesture()
    return structs.replace(copy, outside=names[place])


def _carrier_field(session: SessionView, ui: UiState, copy: ObjectCopy) -> ObjectCopy:
    choices: list[tuple[str, OnPath | OnObject | None]] = [("nothing", None)]
    choices += [(f"camera path {one_line(path.name)}", OnPath(path.name)) for path in session.paths.paths]
    others = (one for one in session.edits.objects if one.object_id != copy.object_id)
    choices += [(one_line(one.name), OnObject(one.object_id)) for one in others]
    words = next((words for words, carrier in choices if carrier == copy.carried_by), "something that was removed")
    chosen = copy
    label_before("Carried by")
    if imgui.begin_combo("##carrier", words):
        for number, (name, carrier) in enumerate(choices):
            if imgui.selectable(f"{name}##{number}", carrier == copy.carried_by)[0]:
                ui.editing.begin_gesture()
                chosen = structs.replace(copy, carried_by=carrier)
            ui.mark(f"copies.carrier {number}")
        imgui.end_combo()
    else:
        ui.mark("copies.carrier")
    return chosen
