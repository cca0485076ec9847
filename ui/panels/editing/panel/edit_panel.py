"""The panel Edit: on top what is selected, below it everything that can be done to it, part by part."""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import ImVec2, imgui

from app.session.session_view import SessionView
from ui.panels.editing.copies.copies_section import draw_copies
from ui.panels.editing.panel.details import draw_chosen
from ui.panels.editing.panel.making import draw_making
from ui.panels.editing.panel.marks import draw_marks
from ui.panels.editing.panel.objects import draw_objects
from ui.panels.editing.panel.select_attribute import draw_attribute
from ui.panels.editing.panel.select_tools import draw_select_tools
from ui.panels.editing.panel.select_volume import draw_volume_numbers
from ui.panels.editing.panel.stack import draw_stack
from ui.panels.editing.panel.target import draw_target
from ui.panels.editing.panel.timing import draw_timing
from ui.panels.editing.panel.world import draw_world
from ui.panels.pieces.widgets import text_warning, text_wrapped_dim
from ui.panels.state import Dispatch, UiState

ROW_GAP = 3.0
"""Between two rows, units: in the smallest window, the first row of what can be done is in sight."""
Section = Callable[[SessionView, Dispatch, UiState], None]
SECTIONS: tuple[Section, ...] = (
    draw_select_tools,
    draw_making,
    draw_objects,
    draw_chosen,
    draw_stack,
    draw_copies,
    draw_timing,
    draw_attribute,
    draw_volume_numbers,
    draw_marks,
    draw_world,
)
"""Parts of the panel, from top to bottom. Those that are needed rarely come last, under headers."""


def draw_edit(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """The target, and below it the parts, which scroll."""
    if session.capture is None:
        text_wrapped_dim("Selecting and editing begin here once a capture is open.")
        return
    ui.editing.follow(session.edits.edits)
    draw_target(session, dispatch, ui)
    imgui.separator()
    # The bar is always there: with it everything is narrower, and would move when it comes.
    flags = imgui.WindowFlags_.always_vertical_scrollbar
    if imgui.begin_child("parts", ImVec2(0, 0), imgui.ChildFlags_.nav_flattened, flags):
        imgui.push_style_var_y(imgui.StyleVar_.item_spacing, ROW_GAP)
        if session.edits.why_not:
            text_warning(session.edits.why_not)
        for draw_section in SECTIONS:
            draw_section(session, dispatch, ui)
        imgui.pop_style_var()
    imgui.end_child()
