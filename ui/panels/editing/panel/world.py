"""How the scene lies in the world: its upward direction, and how long a unit of the scene is."""

from __future__ import annotations

import math

from imgui_bundle import imgui

from app.playback.views.orbit_view import OrbitView
from app.playback.views.scene_axes import UP_AXES
from app.session.editing.edit_commands import SetScale, SetUp
from app.session.session_view import SessionView
from engine.editing.actions import Vector
from ui.panels.editing.fields import label_before
from ui.panels.editing.panel.sections import section_header
from ui.panels.pieces.widgets import text_wrapped_dim
from ui.panels.state import Dispatch, UiState

SCALES = (1e-9, 1e9)


def view_up(view: OrbitView) -> Vector:
    """The upward direction in the picture of a view."""
    x, y, z = (float(value) for value in -view.pose().rotation[1])
    return x, y, z


def draw_world(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Folded away until it is wanted."""
    if not section_header(ui, "world", is_used=ui.editing.asking is not None):
        return
    imgui.begin_disabled(not session.edits.can_edit)
    world, tool = session.edits.world, ui.editing
    label_before("Up is")
    if imgui.begin_combo("##up", _up_words(world.up)):
        for name, axis in UP_AXES.items():
            words = "as the cameras suggest" if axis is None else f"{name} of the scene"
            if imgui.selectable(words, world.up == axis)[0] and world.up != axis:
                dispatch(SetUp(axis))
            ui.mark(f"world.up {name}")
        imgui.end_combo()
    else:
        ui.mark("world.up")
    if imgui.button("From this view"):
        dispatch(SetUp(view_up(session.view)))
    ui.mark("world.view")
    imgui.set_item_tooltip("Takes the up direction of this view")
    imgui.same_line()
    if imgui.button("Three ground points"):
        tool.ask(None if tool.asking == "ground" else "ground")
    ui.mark("world.ground")
    imgui.set_item_tooltip("Click three points on the ground in the picture")
    label_before("1 unit is")
    is_entered, typed = imgui.input_double(
        "##scale", world.meters_per_unit or 0.0, 0.0, 0.0, "%.6g m", imgui.InputTextFlags_.enter_returns_true
    )
    ui.mark("world.scale")
    imgui.set_item_tooltip("Length of one scene unit, 0 if unknown; if set, exports are in metres")
    if is_entered and math.isfinite(typed):
        dispatch(SetScale(typed if typed > 0.0 else None))
    label_before("Length")
    _, length_m = imgui.input_double("##length", tool.length_m, 0.0, 0.0, "%.6g m")
    ui.mark("world.length")
    if math.isfinite(length_m) and SCALES[0] <= length_m <= SCALES[1]:
        tool.length_m = length_m
    if imgui.button("Two points this far apart"):
        tool.ask(None if tool.asking == "length" else "length")
    ui.mark("world.points")
    imgui.set_item_tooltip("Click two points in the picture that are this far apart")
    imgui.end_disabled()
    if world.meters_per_unit is not None:
        text_wrapped_dim(f"Exports are written in metres: {world.meters_per_unit:.6g} m per unit of the scene.")


def _up_words(up: Vector | None) -> str:
    if up is None:
        return "as the cameras suggest"
    name = next((name for name, axis in UP_AXES.items() if axis == up), "")
    return f"{name} of the scene" if name else ", ".join(f"{value:.3f}" for value in up)
