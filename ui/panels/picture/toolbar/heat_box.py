"""The box in the toolbar that says which residual is shown over the picture."""

from __future__ import annotations

from imgui_bundle import imgui

from app.residuals.heat_map import HEAT_KINDS
from app.session.commands import ShowHeat
from app.session.session_view import SessionView
from ui.panels.pieces.slider import slider
from ui.panels.pieces.widgets import box_flags, box_words
from ui.panels.state import Dispatch, UiState

_CLAMPED = imgui.SliderFlags_.always_clamp


def heat_words(session: SessionView) -> str:
    """What the box says."""
    return HEAT_KINDS[session.overlays.heat].label if session.overlays.heat else "Heat"


def draw_heat_box(session: SessionView, dispatch: Dispatch, ui: UiState, width: float) -> None:
    """Which residual is shown over the picture, and how strongly. width: Units."""
    overlays = session.overlays
    imgui.set_next_item_width(width)
    if imgui.begin_combo("##heat", box_words(heat_words(session), width), box_flags(width)):
        if imgui.selectable("None", not overlays.heat)[0]:
            dispatch(ShowHeat(""))
        ui.mark("viewport.heat.none")
        for kind in HEAT_KINDS.values():
            if imgui.selectable(kind.label, overlays.heat == kind.name)[0]:
                dispatch(ShowHeat(kind.name))
            ui.mark(f"viewport.heat.{kind.name}")
            imgui.set_item_tooltip(kind.meaning)
        imgui.separator()
        imgui.set_next_item_width(150)
        percent = slider("Opacity", overlays.heat_opacity * 100.0, 10.0, 100.0, "%.0f %%", _CLAMPED)[1]
        overlays.heat_opacity = percent / 100.0
        ui.mark("viewport.heat.opacity")
        imgui.end_combo()
    ui.mark("viewport.heat")
    imgui.set_item_tooltip("Where the render differs from the previous frame or from the captured picture (7)")
