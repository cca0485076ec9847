"""Drawings of a selecting tool over the picture: its shape, its size under the pointer, and its hint."""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, imgui

from app.session.editing.selection_commands import Rectangle
from engine.camera.projection import to_camera, to_pixels
from engine.camera.rotations import matrices_of
from engine.editing.edit import Prism, Sphere, Volume
from engine.editing.volumes.prisms import axes_of_prism, widths_at
from ui.panels.pieces.widgets import chip
from ui.panels.state import Rect
from ui.style import theme
from ui.style.theme import ON_PICTURE
from ui.viewport.editing.select_tool import MODE_WORDS, TOOL_HINTS, TOOL_WORDS, VOLUME_TOOLS, SelectTool
from ui.viewport.scene import SceneView

N_SEGMENTS, N_EDGES = 48, 8
"""Of circles; of the edges of a prism, those that are drawn."""
WIDTH, RIM_WIDTH = 1.6, 3.6
"""Of lines, and of their dark rims, units."""
LEAST_SHARE = 0.02
"""Of the distance of what is drawn: lines nearer to the eye than this are cut off."""


def draw_tool(
    draw: imgui.ImDrawList, tool: SelectTool, view: SceneView, pane: Rect, density: float, up: np.ndarray
) -> None:
    """Everything of the tool in use, over one picture. Clipped by the caller."""
    if not tool.is_active:
        return
    pointer = imgui.get_io().mouse_pos
    is_over = imgui.is_item_hovered() or tool.is_dragging
    if tool.kind == "brush" and is_over:
        _outlined_circle(draw, (pointer.x, pointer.y), tool.brush_px)
    if is_over:
        imgui.set_mouse_cursor(imgui.MouseCursor_.none if tool.kind == "brush" else imgui.MouseCursor_.hand)
    volume = tool.volume if tool.kind in VOLUME_TOOLS else None
    if tool.is_dragging:
        volume = (
            tool.volume_under(view.seen_from, (pane.x0, pane.y0), density, up) if tool.surface is not None else None
        )
        _draw_shape(draw, tool, pane, density)
    if volume is not None:
        draw_volume(draw, volume, view, pane, density)


def draw_hint(draw: imgui.ImDrawList, tool: SelectTool, area: Rect) -> None:
    """In the upper left corner of an area: the tool in use, and its keys next to it or below."""
    if tool.kind is None:
        return
    mode = tool.held_mode if tool.is_dragging else tool.mode
    x = chip(draw, area.x0, area.y0, f"{TOOL_WORDS[tool.kind]}: {MODE_WORDS[mode].lower()}", color=ON_PICTURE.yellow)
    keys = f"{TOOL_HINTS[tool.kind]}   Shift adds   Ctrl subtracts   Esc leaves"
    width = imgui.calc_text_size(keys).x + 26
    if width < area.x1 - x:
        chip(draw, x + 4, area.y0, keys, color=ON_PICTURE.text_dim)
    elif width < area.width:
        chip(draw, area.x0, area.y0 + 28, keys, color=ON_PICTURE.text_dim)


def _draw_shape(draw: imgui.ImDrawList, tool: SelectTool, pane: Rect, density: float) -> None:
    points = tool.points
    if tool.kind == "brush":
        line: list[imgui.ImVec2Like] = [ImVec2(x, y) for x, y in points]
        draw.add_polyline(line, theme.u32(theme.faded(ON_PICTURE.yellow, 0.3)), 2.0 * tool.brush_px, 0)
        return
    shape = tool.shape((pane.x0, pane.y0), density)
    if shape is None:
        return
    corners = points
    if isinstance(shape, Rectangle):
        (ax, ay), (bx, by) = points[0], points[-1]
        corners = [(ax, ay), (bx, ay), (bx, by), (ax, by)]
    _outlined(draw, corners, is_closed=True)


def draw_volume(draw: imgui.ImDrawList, volume: Volume, view: SceneView, pane: Rect, density: float) -> None:
    """A volume as wire."""
    center = np.asarray(volume.center)
    depth = float(to_camera(center[None], view.world_to_camera)[0, 2])
    near = max(view.near, LEAST_SHARE * abs(depth), 1e-6)
    for line in volume_lines(volume):
        seen = to_camera(line, view.world_to_camera)
        pixels = to_pixels(seen, view.K) / density
        is_before = seen[:, 2] > near
        for i in range(len(line) - 1):
            if is_before[i] and is_before[i + 1]:
                a, b = pixels[i], pixels[i + 1]
                _outlined(draw, [(pane.x0 + a[0], pane.y0 + a[1]), (pane.x0 + b[0], pane.y0 + b[1])])


def volume_lines(volume: Volume) -> list[np.ndarray]:
    """Lines of a wire: three circles of a sphere, twelve edges of a box, ends and some edges of a prism. [n, 3] each,
    scene units"""
    center = np.asarray(volume.center, np.float64)
    if isinstance(volume, Sphere):
        angles = np.linspace(0.0, 2.0 * np.pi, N_SEGMENTS + 1)
        circle = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)
        return [center + volume.radius * np.roll(circle, shift, axis=1) for shift in range(3)]
    if isinstance(volume, Prism):
        return _prism_lines(volume)
    axes = matrices_of(np.asarray(volume.quat) / np.linalg.norm(volume.quat)) * np.asarray(volume.half_sizes)
    lines = []
    for axis in range(3):
        first, second = (other for other in range(3) if other != axis)
        for a in (-1.0, 1.0):
            for b in (-1.0, 1.0):
                middle = center + a * axes[:, first] + b * axes[:, second]
                shares = np.linspace(-1.0, 1.0, 9)[:, None]
                lines.append(middle + shares * axes[:, axis])
    return lines


def _prism_lines(prism: Prism) -> list[np.ndarray]:
    corners = np.array([*prism.outline, prism.outline[0]])
    depths = np.linspace(-1.0, 1.0, 5)
    rings = []
    for depth, width in zip(depths, widths_at(prism, depths), strict=True):
        own = np.column_stack([corners * width, np.full(len(corners), depth)]) * np.asarray(prism.half_sizes)
        rings.append(np.asarray(prism.center) + own @ axes_of_prism(prism).T)
    edges = np.stack(rings, axis=1)[:-1]  # [corners, depths, 3]
    return [rings[0], rings[-1], *edges[:: max(len(edges) // N_EDGES, 1)]]


def _outlined(draw: imgui.ImDrawList, points: list[tuple[float, float]], *, is_closed: bool = False) -> None:
    """A bright line with a dark rim, which is seen on any picture."""
    flags = int(imgui.ImDrawFlags_.closed if is_closed else imgui.ImDrawFlags_.none)
    line: list[imgui.ImVec2Like] = [ImVec2(float(x), float(y)) for x, y in points]
    for color, width in ((theme.faded(theme.VOID, 0.7), RIM_WIDTH), (ON_PICTURE.yellow, WIDTH)):
        draw.add_polyline(line, theme.u32(color), width, flags)


def _outlined_circle(draw: imgui.ImDrawList, at: tuple[float, float], radius: float) -> None:
    middle = ImVec2(*at)
    draw.add_circle(middle, radius, theme.u32(theme.faded(theme.VOID, 0.7)), 0, RIM_WIDTH)
    draw.add_circle(middle, radius, theme.u32(ON_PICTURE.yellow), 0, WIDTH)
