"""The first part of the panel: tools that select with their options, and commands on the selection."""

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
from ui.panels.editing.panel.sections import TALL, reach_section, section_header
from ui.panels.pieces.slider import slider, slider_text
from ui.panels.pieces.widgets import ROW_GAP, elided, row_widths, segment
from ui.panels.state import Dispatch, UiState
from ui.style.theme import TOOL_ICONS
from ui.viewport.editing.select_tool import MODE_WORDS, TOOL_HINTS, TOOL_WORDS, TOOLS, SelectTool

CLAMPED = imgui.SliderFlags_.always_clamp


def near_distance(session: SessionView, tool: SelectTool) -> float:
    """How far apart neighbours are at most, scene units; 0 while anchors are not known."""
    anchors = session.shown_anchors()
    return 0.0 if anchors is None else tool.near_share * anchors.spacing


def all_moving(ui: UiState) -> SelectByAttribute:
    """Selects all that moves, in the way in which tools select."""
    return SelectByAttribute("motion", 1.0, 1.0, ui.selecting.how())


def draw_select_tools(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Tools with a line for the one in use, changes of the selection, and under a header what is needed less often."""
    reach_section(ui, "selection")
    imgui.begin_disabled(not session.selection.can_select)
    _draw_tools(ui.selecting, ui)
    _draw_changes(session.selection, dispatch, ui)
    if section_header(ui, "options", is_open_first=imgui.get_window_height() >= TALL):
        _draw_options(ui.selecting, ui)
        _draw_neighbours(session, dispatch, ui)
    imgui.end_disabled()


def _draw_tools(tool: SelectTool, ui: UiState) -> None:
    """Tools, the way in which they change the selection, and a line for the one in use."""
    width = (imgui.get_content_region_avail().x - ROW_GAP * (len(TOOLS) - 1)) / len(TOOLS)
    for index, kind in enumerate(TOOLS):
        if index:
            imgui.same_line(0, ROW_GAP)
        if segment(f"{TOOL_ICONS[kind]}##{kind}", tool.kind == kind, width):
            tool.choose(kind)
            ui.regions.leave()
        ui.mark(f"selection.{kind}")
        imgui.set_item_tooltip(f"{TOOL_WORDS[kind]}\n{TOOL_HINTS[kind]}")
    widths = row_widths([MODE_WORDS[mode] for mode in SELECT_MODES])
    for index, mode in enumerate(SELECT_MODES):
        if index:
            imgui.same_line(0, ROW_GAP)
        if segment(f"{MODE_WORDS[mode]}##{mode}", tool.mode == mode, widths[index]):
            tool.mode = mode
        ui.mark(f"selection.{mode}")
    if tool.kind == "brush":
        tool.brush_px = _slider("Brush", tool.brush_px, 2.0, 400.0, "%.0f px", ui, is_log=True)
    elif tool.kind == "flood":
        tool.color_tolerance = _slider("Tolerance", tool.color_tolerance, 0.01, 1.0, "%.2f", ui)
    else:  # as high as a slider, so that what follows stays where it is
        imgui.align_text_to_frame_padding()
        kind = tool.kind
        hint = "Choose a tool" if kind is None else f"{TOOL_WORDS[kind]}: {TOOL_HINTS[kind]}"
        imgui.text_disabled(elided(hint, imgui.get_content_region_avail().x))


def _draw_changes(status: SelectionStatus, dispatch: Dispatch, ui: UiState) -> None:
    buttons: tuple[tuple[str, str, str, Callable[[], Any], bool], ...] = (
        ("Moving", "what moves", "Selects everything that moves in this clip", lambda: all_moving(ui), True),
        ("All", "all", "Ctrl+A", SelectAll, True),
        ("None", "none", "Ctrl+Shift+A", ClearSelection, bool(status.words)),
        ("Invert", "invert", "Ctrl+I", InvertSelection, True),
        ("Before", "before", "Restores the previous selection (Alt+Z)", Reselect, status.has_before),
    )
    widths = row_widths([label for label, *_ in buttons])
    for index, (label, name, tooltip, command, is_possible) in enumerate(buttons):
        if index:
            imgui.same_line(0, ROW_GAP)
        imgui.begin_disabled(not is_possible)
        if imgui.button(label, ImVec2(widths[index], 0)):
            invert_selection(dispatch, ui) if command is InvertSelection else dispatch(command())
        ui.mark(f"selection.{name}")
        imgui.end_disabled()
        imgui.set_item_tooltip(tooltip)


def _draw_options(tool: SelectTool, ui: UiState) -> None:
    rows = (
        ("is_visible_only", "Visible only", "Ignores Gaussians hidden behind others"),
        ("is_by_extent", "By extent", "Tests the visible extent of a Gaussian, not only its centre"),
        ("is_whole_anchors", "Whole anchors", "One Gaussian of an anchor selects all of them"),
    )
    end = imgui.get_cursor_screen_pos().x + imgui.get_content_region_avail().x
    for place, (name, label, tooltip) in enumerate(rows):
        box = imgui.get_frame_height() + imgui.get_style().item_inner_spacing.x + imgui.calc_text_size(label).x
        if place and imgui.get_item_rect_max().x + imgui.get_style().item_spacing.x + box <= end:
            imgui.same_line()
        is_changed, is_on = imgui.checkbox(label, getattr(tool, name))
        if is_changed:
            setattr(tool, name, is_on)
        ui.mark(f"selection.{name}")
        imgui.set_item_tooltip(tooltip)


def _draw_neighbours(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Growing and shrinking, and how far neighbours are apart."""
    tool = ui.selecting
    distance = near_distance(session, tool)
    imgui.begin_disabled(not session.selection.words or distance <= 0.0)
    if imgui.button("Grow"):
        dispatch(GrowSelection(distance))
    ui.mark("selection.grow")
    imgui.set_item_tooltip("Ctrl+]")
    imgui.same_line(0, ROW_GAP)
    if imgui.button("Shrink"):
        dispatch(ShrinkSelection(distance))
    ui.mark("selection.shrink")
    imgui.set_item_tooltip("Ctrl+[")
    imgui.end_disabled()
    imgui.same_line(0, ROW_GAP)
    tool.near_share = _slider("Reach", tool.near_share, 0.1, 20.0, "%.1f", ui, is_log=True)
    imgui.set_item_tooltip("Largest gap between neighbours, in anchor spacings; also for flood")


def _slider(
    label: str, value: float, low: float, high: float, words: str, ui: UiState, *, is_log: bool = False
) -> float:
    imgui.set_next_item_width(-imgui.calc_text_size(f"{slider_text(label, high, words)}  ").x)
    flags = CLAMPED | imgui.SliderFlags_.logarithmic if is_log else CLAMPED
    moved = slider(label, value, low, high, words, flags)[1]
    ui.mark(f"selection.{label.lower()}")
    return moved
