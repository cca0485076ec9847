"""The cameras from above, and how well the calibration of each fits: where trouble stands, at a glance."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from imgui_bundle import ImVec2, imgui

from engine.camera.rig import CameraRig
from ui.panels.doctor.words import SEVERITY_WORDS, severity_color
from ui.panels.pieces.widgets import elided
from ui.panels.state import Rect, UiState
from ui.style import theme

MARGIN = 16.0
TICK = 12.0


@dataclass(frozen=True, eq=False)
class CameraPlan:
    """Cameras on the plane that they lie in best.

    Attributes:
        places: Shares of a square, y down. [C, 2]
        directions: Unit, where they look; shorter where they look out of the plane. [C, 2]
    """

    places: np.ndarray
    directions: np.ndarray


def camera_plan(rig: CameraRig) -> CameraPlan:
    """Flatten a rig onto its two widest directions."""
    centers = rig.centers - rig.centers.mean(0)
    _, _, axes = np.linalg.svd(centers, full_matrices=True)
    flat = centers @ axes[:2].T
    low, high = flat.min(0), flat.max(0)
    size = max(float((high - low).max()), 1e-9)
    return CameraPlan((flat - (low + high) / 2) / size + 0.5, rig.forwards @ axes[:2].T)


def draw_map(
    rig: CameraRig, plan: CameraPlan, severities: Mapping[str, str], chosen: frozenset[str], size: ImVec2, ui: UiState
) -> str | None:
    """Draw the map; returns the camera under the pointer that was clicked.

    severities: Of the worst finding of each camera that has one.
    """
    width, height = size.x, size.y
    corner = imgui.get_cursor_screen_pos()
    is_clicked = imgui.invisible_button("##map", ImVec2(width, height))
    ui.mark("doctor.map")
    area = Rect(corner.x, corner.y, corner.x + width, corner.y + height)
    draw = imgui.get_window_draw_list()
    draw.add_rect_filled(area.low, area.high, theme.u32(theme.BACKDROP), 4)
    side = max(min(width, height) - 2 * MARGIN, 1.0)
    x0, y0 = area.center[0] - side / 2, area.center[1] - side / 2
    mouse = imgui.get_mouse_pos()
    nearest, reach = None, 12.0
    for row, name in enumerate(rig.names):
        x, y = x0 + side * float(plan.places[row, 0]), y0 + side * float(plan.places[row, 1])
        severity = severities.get(name)
        color = theme.u32(severity_color(severity) if severity else theme.TEXT_DIM)
        towards = plan.directions[row]
        draw.add_line(ImVec2(x, y), ImVec2(x + TICK * float(towards[0]), y + TICK * float(towards[1])), color, 1.5)
        _draw_sign(draw, x, y, severity, color)
        if name in chosen:
            draw.add_circle(ImVec2(x, y), 9.0, theme.u32(theme.TEXT), 0, 1.5)
            draw.add_text(ImVec2(x + 11, y - 8), theme.u32(theme.TEXT), elided(name, 90.0))
        away = math.hypot(mouse.x - x, mouse.y - y)
        if imgui.is_item_hovered() and away < reach:
            nearest, reach = name, away
    if nearest is not None:
        imgui.set_tooltip(nearest.replace("%", "%%"))
    return nearest if is_clicked else None


def draw_bars(rig: CameraRig, camera_px: np.ndarray, chosen: frozenset[str], height: float, ui: UiState) -> None:
    """By how much features of each camera miss: one bar each, in the order of the rig."""
    known = camera_px[np.isfinite(camera_px)]
    if len(known) == 0:
        return
    width = imgui.get_content_region_avail().x
    corner = imgui.get_cursor_screen_pos()
    imgui.invisible_button("##bars", ImVec2(width, height))
    ui.mark("doctor.bars")
    draw, most = imgui.get_window_draw_list(), max(float(known.max()), 1.0)
    step = width / len(camera_px)
    mouse = imgui.get_mouse_pos()
    base = corner.y + height - 2
    for row, value in enumerate(camera_px):
        x = corner.x + row * step
        is_chosen = rig.names[row] in chosen
        color = theme.u32(theme.TEXT if is_chosen else theme.SKY)
        if math.isfinite(value):
            top = base - (height - 20) * float(value) / most
            draw.add_rect_filled(ImVec2(x + 1, top), ImVec2(x + max(step - 1, 2.0), base), color)
            if is_chosen:
                draw.add_text(ImVec2(min(x, corner.x + width - 28), top - 17), color, f"{value:.1f}")
        else:
            draw.add_line(ImVec2(x + 1, base), ImVec2(x + max(step - 1, 2.0), base), theme.u32(theme.TEXT_DIM))
        if imgui.is_item_hovered() and x <= mouse.x < x + step:
            said = f"{value:.2f} px" if math.isfinite(value) else "too few features"
            imgui.set_tooltip(f"{rig.names[row]}: {said}".replace("%", "%%"))


def _draw_sign(draw: imgui.ImDrawList, x: float, y: float, severity: str | None, color: int) -> None:
    """A dot, a triangle for a warning, a square for an error: distinct without colours."""
    if severity == "error":
        draw.add_rect_filled(ImVec2(x - 5, y - 5), ImVec2(x + 5, y + 5), color)
    elif severity == "warning":
        draw.add_triangle_filled(ImVec2(x, y - 6), ImVec2(x + 6, y + 5), ImVec2(x - 6, y + 5), color)
    else:
        draw.add_circle_filled(ImVec2(x, y), 3.5, color)


def draw_legend(width: float) -> None:
    """Meanings of the map's signs, as much as there is room for, and everything as a tooltip."""
    words = f"Square: {SEVERITY_WORDS['error'].lower()}   Triangle: {SEVERITY_WORDS['warning'].lower()}   Dot: fine"
    imgui.text_disabled(elided(words, width))
    imgui.set_item_tooltip(words)
