"""The selection panel: the selection, the tools that select, and commands on the selection by buttons and numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from imgui_bundle import ImVec2, imgui

from app.session.editing.selection_commands import (
    ClearSelection,
    GrowSelection,
    InvertSelection,
    Reselect,
    SelectAll,
    SelectByAttribute,
    ShrinkSelection,
)
from app.session.editing.selection_status import SelectionStatus
from app.session.session_view import SessionView
from engine.editing.selection.set_algebra import SELECT_MODES
from ui.panels.editing.edit_subject import invert_selection
from ui.panels.editing.selecting.select_attribute import draw_attribute
from ui.panels.editing.selecting.select_volume import draw_volume_numbers
from ui.panels.pieces.slider import slider, slider_text
from ui.panels.pieces.widgets import segment, text_wrapped, text_wrapped_dim
from ui.panels.state import Dispatch, UiState
from ui.viewport.editing.select_tool import MODE_WORDS, TOOL_HINTS, TOOL_WORDS, TOOLS, SelectTool

GAP = 4.0
CLAMPED = imgui.SliderFlags_.always_clamp


def near_distance(session: SessionView, tool: SelectTool) -> float:
    """How far apart neighbours are at most, scene units; 0 while anchors are not known."""
    anchors = session.shown_anchors()
    return 0.0 if anchors is None else tool.near_share * anchors.spacing


def select_moving(dispatch: Dispatch, ui: UiState) -> None:
    """Select all moving, in the way in which tools select."""
    dispatch(SelectByAttribute("motion", 1.0, 1.0, ui.selecting.how()))


def draw_selection(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Everything of it, from top to bottom."""
    status, tool = session.selection, ui.selecting
    if session.capture is None:
        text_wrapped_dim("The selection appears here once a capture is open.")
        return
    if not status.can_select:
        text_wrapped_dim("No Gaussians to select in this frame yet.")
    _draw_counts(status, ui)
    imgui.begin_disabled(not status.can_select)
    imgui.separator_text("Tool")
    _draw_tools(tool, ui)
    if imgui.button("Select all moving", ImVec2(-1, 0)):
        select_moving(dispatch, ui)
    ui.mark("selection.what moves")
    imgui.set_item_tooltip("Everything that moves in this clip, such as people")
    _draw_options(tool, ui)
    imgui.separator_text("Change")
    _draw_changes(session, dispatch, ui)
    imgui.separator_text("By attribute")
    draw_attribute(session, dispatch, ui)
    imgui.separator_text("Volume by numbers")
    draw_volume_numbers(session, dispatch, ui)
    imgui.end_disabled()


def _draw_counts(status: SelectionStatus, ui: UiState) -> None:
    if status.is_busy:
        ui.redraw_within(0.1)
    text_wrapped(status.words or "Nothing is selected")
    ui.mark("selection.counts")
    if status.words and status.n_shown != status.n_gaussians:
        text_wrapped_dim(f"{status.n_shown:,} of them exist in the shown frame")


def _draw_tools(tool: SelectTool, ui: UiState) -> None:
    width = _width_of(3)
    for index, kind in enumerate(TOOLS):
        if index % 3:
            imgui.same_line(0, GAP)
        if segment(f"{TOOL_WORDS[kind]}##{kind}", tool.kind == kind, width):
            tool.choose(kind)
            ui.regions.leave()
        ui.mark(f"selection.{kind}")
        imgui.set_item_tooltip(TOOL_HINTS[kind])
    width = _width_of(len(SELECT_MODES))
    for index, mode in enumerate(SELECT_MODES):
        if index:
            imgui.same_line(0, GAP)
        if segment(f"{MODE_WORDS[mode]}##{mode}", tool.mode == mode, width):
            tool.mode = mode
        ui.mark(f"selection.{mode}")
    if tool.kind == "brush":
        tool.brush_px = _slider("Size", tool.brush_px, 2.0, 400.0, "%.0f px", ui, is_log=True)
    elif tool.kind == "flood":
        tool.color_tolerance = _slider("Tolerance", tool.color_tolerance, 0.01, 1.0, "%.2f", ui)


def _draw_options(tool: SelectTool, ui: UiState) -> None:
    rows = (
        ("is_visible_only", "Visible only", "Ignores Gaussians hidden behind others"),
        ("is_by_extent", "By visible extent", "Tests the visible extent of a Gaussian, not only its centre"),
        ("is_whole_anchors", "Whole anchors", "One Gaussian of an anchor selects all of them"),
    )
    for name, label, tooltip in rows:
        is_changed, is_on = imgui.checkbox(label, getattr(tool, name))
        if is_changed:
            setattr(tool, name, is_on)
        ui.mark(f"selection.{name}")
        imgui.set_item_tooltip(tooltip)


def _draw_changes(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    status, tool = session.selection, ui.selecting
    buttons: tuple[tuple[str, str, Callable[[], Any], bool], ...] = (
        ("All", "Ctrl+A", SelectAll, True),
        ("None", "Ctrl+Shift+A", ClearSelection, bool(status.words)),
        ("Invert", "Ctrl+I", InvertSelection, True),
        ("Before", "Restores the previous selection (Alt+Z)", Reselect, status.has_before),
    )
    width = _width_of(len(buttons))
    for index, (label, tooltip, command, is_possible) in enumerate(buttons):
        if index:
            imgui.same_line(0, GAP)
        imgui.begin_disabled(not is_possible)
        if imgui.button(label, ImVec2(width, 0)):
            invert_selection(dispatch, ui) if command is InvertSelection else dispatch(command())
        ui.mark(f"selection.{label.lower()}")
        imgui.end_disabled()
        imgui.set_item_tooltip(tooltip)
    distance = near_distance(session, tool)
    imgui.begin_disabled(not status.words or distance <= 0.0)
    width = _width_of(2)
    if imgui.button("Grow", ImVec2(width, 0)):
        dispatch(GrowSelection(distance))
    ui.mark("selection.grow")
    imgui.set_item_tooltip("Ctrl+]")
    imgui.same_line(0, GAP)
    if imgui.button("Shrink", ImVec2(width, 0)):
        dispatch(ShrinkSelection(distance))
    ui.mark("selection.shrink")
    imgui.set_item_tooltip("Ctrl+[")
    imgui.end_disabled()
    tool.near_share = _slider("Reach", tool.near_share, 0.1, 20.0, "%.1f anchors", ui, is_log=True)
    imgui.set_item_tooltip("Largest gap between neighbours, in anchor spacings; also for flood")


def _slider(
    label: str, value: float, low: float, high: float, words: str, ui: UiState, *, is_log: bool = False
) -> float:
    imgui.set_next_item_width(-imgui.calc_text_size(f"{slider_text(label, high, words)}  ").x)
    flags = CLAMPED | imgui.SliderFlags_.logarithmic if is_log else CLAMPED
    moved = slider(label, value, low, high, words, flags)[1]
    ui.mark(f"selection.{label.lower()}")
    return moved


def _width_of(n_buttons: int) -> float:
    return (imgui.get_content_region_avail().x - GAP * (n_buttons - 1)) / n_buttons
