"""The part of a camera's picture that is excluded from training, hatched over it; and the brush."""

from __future__ import annotations

from collections.abc import Hashable

import numpy as np
from imgui_bundle import ImVec2, imgui

from app.session.session_view import SessionView
from engine.capture.exclusions import Stroke
from ui.panels.pieces.widgets import chip
from ui.panels.state import Rect, UiState
from ui.style import theme
from ui.style.theme import ON_PICTURE
from ui.viewport.excluding.hatched_mask import hatch_lines
from ui.viewport.excluding.mask_tool import SCOPES, MaskTool

LINE_WIDTH, SHADOW_WIDTH = 1.6, 3.4
WHOLE_SPACING = 22.0
"""Between the lines over a picture that is excluded as a whole, units."""


def exclusion_of(session: SessionView, camera_index: int, frame_index: int) -> str:
    """That a picture is excluded as a whole, in words; empty where it is not."""
    name, found = session.rig.names[camera_index], session.exclusions
    if name in found.cameras:
        return "The camera is excluded from training"
    for one in found.frames:
        if one.camera in (None, name) and one.first <= frame_index < one.stop:
            return "This frame is excluded from training" + ("" if one.camera is None else " for this camera")
    return ""


class ExcludedDrawing:
    """Keeps the hatching of the masks that were drawn last."""

    def __init__(self) -> None:
        self._key: Hashable = None
        self._lines = np.zeros((0, 4))

    def draw(self, draw: imgui.ImDrawList, session: SessionView, ui: UiState, pane: Rect) -> None:
        """Over one picture, clipped by the caller; nothing over a free view."""
        camera = session.view.look_through
        if camera is None or camera >= len(session.rig.names):
            return
        frame, tool = session.timeline.frame_index, ui.masks
        words = exclusion_of(session, camera, frame)
        if words:
            _hatch_whole(draw, pane)
            chip(draw, pane.x0 + 10, pane.y1 - 64, words, color=ON_PICTURE.yellow)
        self._draw_masks(draw, session, tool, camera, frame, pane)
        if tool.is_active and tool.camera_index == camera:
            _draw_brush(draw, tool, pane)
            chip(draw, pane.x0 + 10, pane.y0 + 44, brush_hint(tool, session.rig.names[camera]), color=ON_PICTURE.yellow)

    def _draw_masks(
        self, draw: imgui.ImDrawList, session: SessionView, tool: MaskTool, camera: int, frame: int, pane: Rect
    ) -> None:
        name = session.rig.names[camera]
        masks = [
            one.strokes for one in session.exclusions.masks if one.camera == name and one.first <= frame < one.stop
        ]
        key = (tuple(id(strokes) for strokes in masks), camera)
        if key != self._key:
            self._lines, self._key = hatch_lines(masks, pane.width / max(pane.height, 1.0)), key
        _draw_lines(draw, self._lines, pane)
        if tool.points and not tool.is_erasing:
            going = [(Stroke(tuple(tool.points), tool.radius),)]
            _draw_lines(draw, hatch_lines(going, pane.width / max(pane.height, 1.0)), pane)


def brush_hint(tool: MaskTool, name: str) -> str:
    """The function of the brush, in one line."""
    return (
        f"Masking part of {name} in {SCOPES[tool.scope]}: drag paints, Shift erases, Ctrl+wheel sizes, "
        "the same key or menu entry ends it"
    )


def _draw_lines(draw: imgui.ImDrawList, lines: np.ndarray, pane: Rect) -> None:
    dark, bright = theme.u32(theme.faded(theme.VOID, 0.75)), theme.u32(ON_PICTURE.yellow)
    ends = lines * (pane.width, pane.height, pane.width, pane.height) + (pane.x0, pane.y0, pane.x0, pane.y0)
    for color, width in ((dark, SHADOW_WIDTH), (bright, LINE_WIDTH)):
        for x0, y0, x1, y1 in ends.tolist():
            draw.add_line(ImVec2(x0, y0), ImVec2(x1, y1), color, width)


def _hatch_whole(draw: imgui.ImDrawList, pane: Rect) -> None:
    dark, bright = theme.u32(theme.faded(theme.VOID, 0.6)), theme.u32(theme.faded(ON_PICTURE.yellow, 0.75))
    x = pane.x0 - pane.height
    while x < pane.x1:
        for color, width in ((dark, SHADOW_WIDTH), (bright, LINE_WIDTH)):
            draw.add_line(ImVec2(x, pane.y1), ImVec2(x + pane.height, pane.y0), color, width)
        x += WHOLE_SPACING


def _draw_brush(draw: imgui.ImDrawList, tool: MaskTool, pane: Rect) -> None:
    pointer = imgui.get_io().mouse_pos
    if not pane.contains(pointer.x, pointer.y):
        return
    radius = tool.radius * pane.width
    draw.add_circle(pointer, radius, theme.u32(theme.faded(theme.VOID, 0.8)), 48, SHADOW_WIDTH)
    draw.add_circle(pointer, radius, theme.u32(ON_PICTURE.yellow), 48, LINE_WIDTH)
