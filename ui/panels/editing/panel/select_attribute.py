"""Selecting by an attribute: how it is spread, and a range of it that is chosen by its handles or by numbers."""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, imgui

from app.session.editing.attributes import ATTRIBUTES, Attribute
from app.session.editing.selection_commands import SelectByAttribute
from app.session.session_view import SessionView
from engine.editing.selection.ranges import ValueSpread
from ui.panels.editing.panel.sections import section_header
from ui.panels.pieces.widgets import primary_button, text_wrapped_dim
from ui.panels.state import Dispatch, Rect, UiState
from ui.style import theme
from ui.style.numbers import number_format
from ui.viewport.editing.select_tool import SelectTool

HEIGHT = 72.0
GRAB_PX = 8.0


def draw_attribute(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Choice of the attribute, its histogram, its range, and the button."""
    if not section_header(ui, "attribute"):
        return
    imgui.begin_disabled(not session.selection.can_select)
    _draw_choice(session, dispatch, ui)
    imgui.end_disabled()


def _draw_choice(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    tool = ui.selecting
    chosen = ATTRIBUTES[tool.attribute]
    imgui.set_next_item_width(-1)
    if imgui.begin_combo("##attribute", chosen.label):
        for name, attribute in ATTRIBUTES.items():
            if imgui.selectable(attribute.label, name == tool.attribute)[0]:
                tool.attribute = name
            ui.mark(f"selection.attribute.{name}")
        imgui.end_combo()
    ui.mark("selection.attribute")
    if chosen.choices:
        _draw_choices(chosen, dispatch, ui)
        return
    spread = session.attribute_spread(chosen.name)
    if spread is None:
        words = "Anchors are compared with the cameras ..." if chosen.column else "Not known in this frame."
        text_wrapped_dim(words)
        ui.redraw_within(0.3)
        return
    _draw_histogram(spread, tool, ui)
    low, high = (spread.value_at(share) for share in _range(tool))
    _draw_numbers(spread, chosen, tool, ui, low, high)
    if primary_button("Select this range", ImVec2(imgui.get_content_region_avail().x, 30), ui):
        # The ends of the axis were rounded on their way here and back.
        low_share, high_share = _range(tool)
        low = spread.low if low_share <= 0.0 else low
        high = spread.high if high_share >= 1.0 else high
        dispatch(SelectByAttribute(chosen.name, low, high, tool.how()))
    ui.mark("selection.by_range")
    if spread.n_unknown:
        text_wrapped_dim(f"Not known for {spread.n_unknown:,} Gaussians.")


def _range(tool: SelectTool) -> tuple[float, float]:
    return tool.ranges.get(tool.attribute, (0.0, 1.0))


def _draw_choices(chosen: Attribute, dispatch: Dispatch, ui: UiState) -> None:
    for value, words in chosen.choices:
        if imgui.button(f"{words[0].upper()}{words[1:]}", ImVec2(imgui.get_content_region_avail().x, 0)):
            dispatch(SelectByAttribute(chosen.name, value, value, ui.selecting.how()))
        ui.mark(f"selection.choice.{chosen.name}.{value:g}")


def _draw_histogram(spread: ValueSpread, tool: SelectTool, ui: UiState) -> None:
    """Bars as high as the logarithm of their count, so that rare values show; the handle nearer to a press follows the
    pointer."""
    start, width = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
    area = Rect(start.x, start.y, start.x + width, start.y + HEIGHT)
    imgui.invisible_button("histogram", ImVec2(max(width, 1.0), HEIGHT))
    ui.mark("selection.histogram")
    if imgui.is_item_active():
        share = min(max((imgui.get_io().mouse_pos.x - area.x0) / max(width, 1.0), 0.0), 1.0)
        low, high = _range(tool)
        if imgui.is_item_activated():
            tool.is_high_held = abs(share - high) < abs(share - low) or (low == high and share > high)
        tool.ranges[tool.attribute] = (low, max(share, low)) if tool.is_high_held else (min(share, high), high)
    low, high = _range(tool)
    draw = imgui.get_window_draw_list()
    draw.add_rect_filled(area.low, area.high, theme.u32(theme.BACKDROP), 3)
    heights = np.log1p(spread.counts) / max(float(np.log1p(spread.counts.max())), 1e-9)
    bar = width / len(heights)
    for index, height in enumerate(heights):
        if height <= 0.0:
            continue
        is_in = low <= (index + 0.5) / len(heights) <= high
        top = area.y1 - 2 - (HEIGHT - 6) * float(height)
        color = theme.YELLOW if is_in else theme.TEXT_DIM
        x0 = area.x0 + index * bar
        if is_in:
            draw.add_rect_filled(ImVec2(x0, top), ImVec2(x0 + max(bar - 1, 1), area.y1), theme.u32(color))
        else:  # distinguished without its hue too
            draw.add_rect(ImVec2(x0, top), ImVec2(x0 + max(bar - 1, 2), area.y1), theme.u32(color))
    for share in (low, high):
        x = area.x0 + share * width
        draw.add_line(ImVec2(x, area.y0), ImVec2(x, area.y1), theme.u32(theme.TEXT), 2)
        draw.add_triangle_filled(
            ImVec2(x - GRAB_PX / 2, area.y0),
            ImVec2(x + GRAB_PX / 2, area.y0),
            ImVec2(x, area.y0 + GRAB_PX),
            theme.u32(theme.TEXT),
        )


def _draw_numbers(
    spread: ValueSpread, chosen: Attribute, tool: SelectTool, ui: UiState, low: float, high: float
) -> None:
    unit = f"  {chosen.unit}" if chosen.unit else ""
    room = (imgui.get_content_region_avail().x - imgui.calc_text_size(unit).x - 8) / 2
    changed = []
    finest = 1e-8 if spread.is_log or spread.high <= spread.low else (spread.high - spread.low) / 1000
    for name, value in (("low", low), ("high", high)):
        if name == "high":
            imgui.same_line(0, 4)
        imgui.set_next_item_width(max(room, 40.0))
        is_changed, typed = imgui.input_float(f"##{name}", value, 0.0, 0.0, number_format(value, finest))
        ui.mark(f"selection.{name}")
        changed.append((is_changed, typed))
    if unit:
        imgui.same_line(0, 0)
        imgui.text_disabled(unit)
    low_share, high_share = _range(tool)
    if changed[0][0] and np.isfinite(changed[0][1]):
        low_share = min(spread.share_at(changed[0][1]), high_share)
    if changed[1][0] and np.isfinite(changed[1][1]):
        high_share = max(spread.share_at(changed[1][1]), low_share)
    if changed[0][0] or changed[1][0]:
        tool.ranges[tool.attribute] = (low_share, high_share)
