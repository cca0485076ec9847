"""Handles of what is edited, drawn over one picture: wire, points and rings, each with a dark rim and a shape of its
own, so that they are distinguished on light and dark and without colours.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from imgui_bundle import ImVec2, imgui

from engine.editing.actions import Transform
from ui.panels.editing.edit_grip import lens_of
from ui.panels.editing.edit_subject import Subject
from ui.panels.editing.selecting.select_drawing import draw_volume
from ui.panels.picture.gizmo import COLORS, LETTERS
from ui.panels.pieces.widgets import chip
from ui.panels.state import Rect, UiState
from ui.style import theme
from ui.style.theme import ON_PICTURE
from ui.viewport.editing.edit_tool import N_ASKED, EditTool
from ui.viewport.editing.handles import Handle, HandleView, handles_of, middle_of, place_of, ring_of
from ui.viewport.scene import SceneView

HALF, LARGE_HALF = 5.0, 7.0
LINE, RIM = 1.8, 2.4
ASKED_WORDS = {
    "ground": "Click three points on the ground",
    "length": "Click two points at a known distance",
}


def draw_handles(
    draw: imgui.ImDrawList, subject: Subject, ui: UiState, view: SceneView, pane: Rect, density: float
) -> None:
    """Wire and handles of one thing. Clipped by the caller."""
    lens, tool, thing = lens_of(view, density), ui.editing, subject.thing
    if not isinstance(thing, Transform):
        draw_volume(draw, thing, view, pane, density)
    for handle in reversed(handles_of(thing)):
        is_pointed = handle == (tool.held or tool.pointed)
        if handle.kind == "ring":
            _draw_ring(draw, ui, ring_of(thing, handle, lens), handle, lens, pane, is_pointed=is_pointed)
            continue
        at = _on_screen(place_of(thing, handle, lens), lens, pane)
        if at is None:
            continue
        ui.mark_rect(f"handle.{handle.name}", Rect(at[0] - HALF, at[1] - HALF, at[0] + HALF, at[1] + HALF))
        if handle.kind in ("arrow", "scale"):
            middle = _on_screen(middle_of(thing), lens, pane)
            if middle is not None:
                color = COLORS[handle.axis] if handle.kind == "arrow" else ON_PICTURE.text
                _line(draw, middle, at, color, LINE + is_pointed)
        _draw_point(draw, at, handle, is_pointed=is_pointed)


def draw_edit_hint(draw: imgui.ImDrawList, tool: EditTool, area: Rect) -> None:
    """In the upper left corner of an area: what handles do, or which points are asked for."""
    if tool.asking is not None:
        text = f"{ASKED_WORDS[tool.asking]}: {len(tool.points)} of {N_ASKED[tool.asking]}   Esc leaves"
        chip(draw, area.x0, area.y0, text, color=ON_PICTURE.yellow)
    elif tool.held is not None:
        text = f"{tool.held.verb.capitalize()}   Ctrl snaps   Esc cancels"
        if tool.held.kind == "face":
            text += "   Shift moves the whole volume"
        chip(draw, area.x0, area.y0, text, color=ON_PICTURE.yellow)


def draw_points(draw: imgui.ImDrawList, tool: EditTool, view: SceneView, pane: Rect, density: float) -> None:
    """The points that were given so far, and lines between them."""
    lens = lens_of(view, density)
    places = [_on_screen(point, lens, pane) for point in tool.points]
    for before, after in pairwise(places):
        if before is not None and after is not None:
            _line(draw, before, after, ON_PICTURE.yellow, LINE)
    for place in places:
        if place is not None:
            _draw_point(draw, place, Handle("center"), is_pointed=True)


def _draw_ring(
    draw: imgui.ImDrawList,
    ui: UiState,
    ring: np.ndarray,
    handle: Handle,
    lens: HandleView,
    pane: Rect,
    *,
    is_pointed: bool,
) -> None:
    pixels, is_seen = lens.pixels(ring)
    if not is_seen.all():
        return
    x, y = pixels[len(pixels) // 8] / lens.pixels_per_unit + [pane.x0, pane.y0]  # between two other rings
    ui.mark_rect(f"handle.{handle.name}", Rect(x - 1, y - 1, x + 1, y + 1))
    color = ON_PICTURE.playhead if is_pointed else theme.faded(COLORS[handle.axis], 0.9)
    for shade, width in ((theme.faded(theme.VOID, 0.6), LINE + RIM), (color, LINE + is_pointed)):
        draw.path_clear()
        for x, y in pixels / lens.pixels_per_unit:
            draw.path_line_to(ImVec2(pane.x0 + float(x), pane.y0 + float(y)))
        draw.path_stroke(theme.u32(shade), thickness=width)


def _draw_point(draw: imgui.ImDrawList, at: tuple[float, float], handle: Handle, *, is_pointed: bool) -> None:
    """A square changes sizes, a disc moves freely, a triangle with a letter along an axis, a diamond scales."""
    half = LARGE_HALF if is_pointed else HALF
    x, y = at
    rim = theme.u32(theme.VOID)
    color = theme.u32(ON_PICTURE.playhead if is_pointed else ON_PICTURE.yellow)
    if handle.kind in ("face", "radius"):
        draw.add_rect_filled(ImVec2(x - half - 1.5, y - half - 1.5), ImVec2(x + half + 1.5, y + half + 1.5), rim, 2)
        draw.add_rect_filled(ImVec2(x - half, y - half), ImVec2(x + half, y + half), color, 1)
    elif handle.kind == "arrow":
        color = theme.u32(ON_PICTURE.playhead if is_pointed else COLORS[handle.axis])
        draw.add_circle_filled(ImVec2(x, y), half + 4.5, rim)
        draw.add_circle_filled(ImVec2(x, y), half + 3, color)
        letter = LETTERS[handle.axis]
        size = imgui.calc_text_size(letter)
        draw.add_text(ImVec2(x - size.x / 2, y - size.y / 2), rim, letter)
    elif handle.kind == "scale":
        for grown, shade in ((2.5, rim), (0.0, color)):
            r = half + 1 + grown
            draw.add_quad_filled(ImVec2(x, y - r), ImVec2(x + r, y), ImVec2(x, y + r), ImVec2(x - r, y), shade)
    else:
        draw.add_circle_filled(ImVec2(x, y), half + 1.5, rim)
        draw.add_circle_filled(ImVec2(x, y), half, color)


def _line(
    draw: imgui.ImDrawList, start: tuple[float, float], stop: tuple[float, float], color: theme.Color, width: float
) -> None:
    draw.add_line(ImVec2(*start), ImVec2(*stop), theme.u32(theme.faded(theme.VOID, 0.6)), width + RIM)
    draw.add_line(ImVec2(*start), ImVec2(*stop), theme.u32(color), width)


def _on_screen(place: np.ndarray, lens: HandleView, pane: Rect) -> tuple[float, float] | None:
    """Where a place is seen, window coordinates; None behind the eye."""
    pixels, is_seen = lens.pixels(np.asarray(place)[None])
    if not is_seen[0]:
        return None
    x, y = pixels[0] / lens.pixels_per_unit
    return pane.x0 + float(x), pane.y0 + float(y)
