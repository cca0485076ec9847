"""Marks for training, under a header of the panel: the sphere that is being chosen, and the list, static or moving."""

from __future__ import annotations

import math

from imgui_bundle import ImVec2, ImVec4, imgui

from app.session.editing.mark_commands import RemoveRegion
from app.session.session_view import SessionView
from app.status import RegionsStatus
from engine.gate.regions import GateRegion
from ui.panels.editing.panel.sections import section_header
from ui.panels.pieces.widgets import chip, primary_button, text_right, text_warning, text_wrapped_dim
from ui.panels.state import Dispatch, Rect, UiState
from ui.style import theme
from ui.style.numbers import format_count
from ui.style.palette import ThemeColors
from ui.style.theme import Icon
from ui.viewport.region_tool import REGION_WORDS

MEANINGS = {"static": "Nothing inside moves or changes.", "dynamic": "Everything inside may move or change."}
ROW_HEIGHT, MOST_ROWS = 44.0, 4.5


def begin_choosing(session: SessionView, ui: UiState) -> None:
    """Start choosing a sphere, or switch what it means; where nothing can be marked the panel says why."""
    ui.show_edit("regions")
    if session.regions.can_mark:
        ui.selecting.kind, ui.selecting.points = None, []
        ui.regions.begin()
    else:
        ui.regions.leave()


def draw_marks(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Choosing, the list, and in which clips all of it takes effect."""
    status = session.regions
    if not section_header(ui, "regions", is_used=ui.regions.is_active):
        return
    if ui.regions.is_active:
        _draw_choice(ui)
    else:
        imgui.begin_disabled(not status.can_mark)
        if primary_button(f"{Icon.REGION}  Mark a region", ImVec2(imgui.get_content_region_avail().x, 36), ui):
            begin_choosing(session, ui)
        ui.mark("regions.begin")
        imgui.end_disabled()
        imgui.set_item_tooltip("M")
        if status.why_not:
            text_warning(status.why_not)
    imgui.spacing()
    _draw_list(status, dispatch, ui)
    if status.effect:
        text_wrapped_dim(status.effect)
        if "again" in status.effect:
            text_wrapped_dim("To retrain a clip, right-click it in the timeline.")


def _draw_choice(ui: UiState) -> None:
    """Meaning and size of the sphere, and the two ways to finish."""
    tool = ui.regions
    half = (imgui.get_content_region_avail().x - 8) / 2
    for treat, words in REGION_WORDS.items():
        if treat != "static":
            imgui.same_line()
        is_on = tool.treat == treat
        imgui.push_style_color(imgui.Col_.button, ImVec4(*(theme.RAISED_ACTIVE if is_on else theme.BACKDROP)))
        if imgui.button(f"      {words.capitalize()}##treat", ImVec2(half, 32)):
            tool.treat = treat
        imgui.pop_style_color()
        ui.mark(f"regions.{words}")
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        draw = imgui.get_window_draw_list()
        draw_region_mark(draw, ImVec2(low.x + 20, (low.y + high.y) / 2), treat)
        if is_on:
            draw.add_rect(low, high, theme.u32(theme.REGION_COLORS[treat]), 4, thickness=2)
        imgui.set_item_tooltip(f"{MEANINGS[treat]} M switches.")
    text_wrapped_dim(MEANINGS[tool.treat])
    imgui.text_disabled("Radius")
    text_right(f"{tool.radius:.3g} scene units", theme.TEXT)
    imgui.set_next_item_width(-1)
    low_radius, high_radius = tool.radius_limits
    flags = imgui.SliderFlags_.logarithmic | imgui.SliderFlags_.always_clamp
    is_moved, radius = imgui.slider_float("##radius", tool.radius, low_radius, high_radius, "", flags)
    ui.mark("regions.radius")
    if is_moved:
        tool.set_radius(radius)
    imgui.set_item_tooltip("The mouse wheel over the picture, - and + change it, too.")
    imgui.begin_disabled(tool.sphere is None)
    if primary_button(f"{Icon.CHECK}  Mark", ImVec2(half, 32), ui):
        tool.is_accepted = True
        ui.redraw_within(0.0)
    ui.mark("regions.accept")
    imgui.end_disabled()
    imgui.set_item_tooltip("Enter")
    imgui.same_line()
    if imgui.button("Cancel", ImVec2(half, 32)):
        tool.leave()
    ui.mark("regions.cancel")
    imgui.set_item_tooltip("Escape")
    text_wrapped_dim("Click in the picture to place it. Ctrl + arrows, Page Up and Page Down move it.")


def _draw_list(status: RegionsStatus, dispatch: Dispatch, ui: UiState) -> None:
    """One row per region, the newest last: it overrules the others."""
    if not status.regions:
        text_wrapped_dim("No marks: what is static and what moves is found from the pictures alone.")
        return
    imgui.text(f"{len(status.regions)} marked")
    if len(status.regions) > 1:
        imgui.same_line()
        imgui.text_disabled("later ones overrule earlier ones")
    n_rows = min(len(status.regions), MOST_ROWS)
    height = n_rows * (ROW_HEIGHT + imgui.get_style().item_spacing.y) + 8
    removed = None
    if imgui.begin_child("list", ImVec2(0, height)):
        for index, region in enumerate(status.regions):
            if _draw_row(index, region, status.can_mark, ui):
                removed = index
    imgui.end_child()
    if removed is not None:
        dispatch(RemoveRegion(removed))


def _draw_row(index: int, region: GateRegion, can_mark: bool, ui: UiState) -> bool:
    """Returns whether the region is to be removed."""
    tool = ui.regions
    imgui.push_id(index)
    flags = imgui.SelectableFlags_.allow_overlap
    if imgui.selectable("##region", tool.highlighted == index, flags, ImVec2(0, ROW_HEIGHT))[0]:
        tool.highlighted = None if tool.highlighted == index else index
    ui.mark(f"regions.row{index}")
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    draw = imgui.get_window_draw_list()
    draw_region_mark(draw, ImVec2(low.x + 14, low.y + 13), region.treat)
    is_sphere = region.radius > 0.0
    shape = f"sphere, radius {region.radius:.3g}" if is_sphere else "box"
    title = f"{index + 1}  {REGION_WORDS[region.treat]} {shape}"
    draw.add_text(ImVec2(low.x + 28, low.y + 4), theme.u32(theme.TEXT), title)
    place = ", ".join(f"{value:.3g}" for value in region.center)
    draw.add_text(ImVec2(low.x + 28, low.y + 23), theme.u32(theme.TEXT_DIM), f"around {place}")
    imgui.same_line(imgui.get_content_region_avail().x - 30)
    imgui.set_cursor_screen_pos(ImVec2(high.x - 34, low.y + 8))
    imgui.begin_disabled(not can_mark)
    is_clicked = imgui.button(Icon.TRASH)
    ui.mark(f"regions.remove{index}")
    imgui.end_disabled()
    imgui.set_item_tooltip("Remove this region (N highlights the next one, Delete removes it)")
    imgui.pop_id()
    return is_clicked


def draw_region_mark(draw: imgui.ImDrawList, middle: ImVec2, treat: str, palette: ThemeColors | None = None) -> None:
    """The small sign of a treatment: a whole ring for static, a dashed one for moving. palette: Not that of panels."""
    color = theme.u32((theme.REGION_COLORS if palette is None else palette.region_colors)[treat])
    if treat == "static":
        draw.add_circle(middle, 6, color, 0, 2)
        return
    for i in range(4):
        start = i * math.pi / 2
        draw.path_arc_to(middle, 6, start, start + math.pi / 3.4, 6)
        draw.path_stroke(color, thickness=2)


def draw_chosen_sphere(ui: UiState, draw: imgui.ImDrawList, area: Rect, counts: dict[str, int]) -> None:
    """Over the picture, from the upper left corner of an area: the sphere being chosen, its contents, and the keys."""
    tool = ui.regions
    text = f"      Mark as {REGION_WORDS[tool.treat]}:  radius {tool.radius:.3g}{_held_text(counts)}"
    chip(draw, area.x0, area.y0, text)
    draw_region_mark(draw, ImVec2(area.x0 + 16, area.y0 + 12), tool.treat, theme.ON_PICTURE)
    place = "Click elsewhere to move it" if tool.is_placed else "Click to place it"
    other = REGION_WORDS["dynamic" if tool.treat == "static" else "static"]
    keys = f"{place}   Wheel size   M {other} instead   Enter marks it   Esc leaves"
    if imgui.calc_text_size(keys).x + 30 < area.width:  # the panel says it too
        chip(draw, area.x0, area.y0 + 28, keys, color=theme.ON_PICTURE.text_dim)


def _held_text(counts: dict[str, int]) -> str:
    if not counts:
        return ""
    return ",  holds " + ", ".join(f"{format_count(n)} {role}" for role, n in counts.items()) + " anchors"
