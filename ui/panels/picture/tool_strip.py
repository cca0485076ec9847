"""The strip at the left edge of the picture: tools that select, and moving, each by one press."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from imgui_bundle import ImVec2, imgui

from app.session.session_view import SessionView
from engine.editing.actions import Transform
from ui.panels.actions.action import Action
from ui.panels.actions.editing import editing, selecting
from ui.panels.editing.edit_subject import meant
from ui.panels.pieces.widgets import segment
from ui.panels.state import Dispatch, Rect, UiState
from ui.style import theme
from ui.style.theme import TOOL_ICONS, Icon
from ui.viewport.editing.select_tool import TOOL_HINTS, TOOL_WORDS, TOOLS

STRIP_WIDTH = 36.0
MARGIN, GAP, APART = 4.0, 3.0, 8.0
"""Around the buttons, between two, and in front of what does not select, units."""
BAR = 3.0
"""Width of the line beside the tool in use, which shows it without its colour, units."""
MOVE = "move"


@dataclass(frozen=True, slots=True)
class _Tool:
    """One button. words: For its tooltip. hint: How it is used, or why it cannot be."""

    name: str
    icon: str
    words: str
    action: Action
    hint: str
    is_on: bool
    is_offered: bool


def draw_tool_strip(session: SessionView, dispatch: Dispatch, ui: UiState, area: Rect) -> None:
    """The tools from top to bottom; those without room are in a menu at the end."""
    imgui.get_window_draw_list().add_rect_filled(area.low, area.high, theme.u32(theme.PANEL))
    tools, side = _tools(session, ui), area.width - 2 * MARGIN
    room = area.height - 2 * MARGIN - APART
    n_fit = int((room + GAP) // (side + GAP))
    shown = tools if n_fit >= len(tools) else tools[: max(n_fit - 1, 0)]
    y = area.y0 + MARGIN
    for tool in shown:
        y += APART if tool.name == MOVE else 0.0
        imgui.set_cursor_screen_pos(ImVec2(area.x0 + MARGIN, y))
        _draw_tool(session, dispatch, ui, tool, side)
        y += side + GAP
    if len(shown) < len(tools) and n_fit >= 1:
        imgui.set_cursor_screen_pos(ImVec2(area.x0 + MARGIN, y))
        _draw_more(session, dispatch, ui, tools[len(shown) :], side)


def _tools(session: SessionView, ui: UiState) -> tuple[_Tool, ...]:
    actions = {action.id: action for action in (*selecting.ACTIONS, *editing.ACTIONS)}
    found = []
    for kind in TOOLS:
        action = actions[f"select.{kind}"]
        why_not = action.why_not(session, ui)
        is_on, words = ui.selecting.kind == kind, f"Select: {TOOL_WORDS[kind].lower()}"
        found.append(_Tool(kind, TOOL_ICONS[kind], words, action, why_not or TOOL_HINTS[kind], is_on, not why_not))
    action = actions["edit.move"]
    edit = session.edits.edit(ui.editing.chosen)
    is_moving = edit is not None and isinstance(edit.action, Transform)
    why_not = action.why_not(session, ui)
    if not (why_not or is_moving or meant(session, ui)[1]):
        why_not = "Select something first"
    hint = why_not or "Moves, turns and scales what is selected by handles in the picture"
    found.append(_Tool(MOVE, Icon.MOVE, "Move", action, hint, is_moving, not why_not))
    return tuple(found)


def _draw_tool(session: SessionView, dispatch: Dispatch, ui: UiState, tool: _Tool, side: float) -> None:
    imgui.begin_disabled(not tool.is_offered)
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(0, 0))
    if segment(f"{tool.icon}##{tool.name}", tool.is_on, side, side):
        _use(session, dispatch, ui, tool)
    imgui.pop_style_var()
    imgui.end_disabled()
    ui.mark(f"strip.{tool.name}")
    if tool.is_on:
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        draw = imgui.get_window_draw_list()
        draw.add_rect_filled(ImVec2(low.x - MARGIN, low.y), ImVec2(low.x - MARGIN + BAR, high.y), theme.u32(theme.TEXT))
    if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip | imgui.HoveredFlags_.allow_when_disabled):
        imgui.set_tooltip(f"{_with_keys(tool, ui)}\n{tool.hint}")


def _draw_more(session: SessionView, dispatch: Dispatch, ui: UiState, tools: Sequence[_Tool], side: float) -> None:
    """The button at the end of the strip, lit while a tool of its menu is in use, and the menu."""
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(0, 0))
    if segment(f"{Icon.MORE}##tools", any(tool.is_on for tool in tools), side, side):
        imgui.open_popup("tools")
    imgui.pop_style_var()
    ui.mark("strip.more")
    imgui.set_item_tooltip("More tools")
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    imgui.set_next_window_pos(ImVec2(high.x + 6, low.y), imgui.Cond_.appearing)
    if not imgui.begin_popup("tools"):
        return
    for tool in tools:
        label = f"{tool.icon}  {tool.words}##{tool.name}"
        if imgui.menu_item(label, ui.keys.label(tool.action), tool.is_on, tool.is_offered)[0]:
            _use(session, dispatch, ui, tool)
        ui.mark(f"strip.{tool.name}")
        if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip | imgui.HoveredFlags_.allow_when_disabled):
            imgui.set_tooltip(tool.hint)
    imgui.end_popup()


def _use(session: SessionView, dispatch: Dispatch, ui: UiState, tool: _Tool) -> None:
    """Take a tool, or put the one in use away."""
    if tool.name == MOVE and tool.is_on:
        ui.editing.leave()
    else:
        tool.action.run(session, dispatch, ui)


def _with_keys(tool: _Tool, ui: UiState) -> str:
    keys = ", ".join(ui.keys.labels(tool.action))
    return f"{tool.words} ({keys})" if keys else tool.words
