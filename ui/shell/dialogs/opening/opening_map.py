"""A map of a rig from above: where cameras stand and look, and which of them are held out. A click changes that."""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, imgui

from app.project.opening.capture_report import CaptureReport
from ui.panels.state import Rect, UiState
from ui.style import theme

MARGIN = 16.0
LOOK_LENGTH = 13.0
DOT = 4.5
REACH = 12.0
"""So far from a camera, in units, the pointer still means it."""


def seen_from_above(report: CaptureReport) -> tuple[np.ndarray, np.ndarray]:
    """Places of the cameras and of what they look at, along two level axes; and where each looks, level part only.

    Returns:
        [C + 1, 2], the last row the point that they look at; [C, 2].
    """
    up = report.up
    centers = np.stack([camera.center for camera in report.cameras])
    forwards = np.stack([camera.forward for camera in report.cameras])
    level = forwards - (forwards @ up)[:, None] * up
    ahead = level.mean(axis=0)
    if np.linalg.norm(ahead) < 1e-3:  # a ring looks everywhere
        ahead = np.cross(up, np.array([1.0, 0.0, 0.0]) if abs(up[0]) < 0.9 else np.array([0.0, 1.0, 0.0]))
    ahead /= np.linalg.norm(ahead)
    axes = np.stack([np.cross(ahead, up), -ahead])  # right, and down the screen: what they look at lies above
    places = np.concatenate([centers, report.focus_point[None]])
    return places @ axes.T, level @ axes.T


def placed(places: np.ndarray, box: Rect) -> np.ndarray:
    """Places on a plane as places in a box, all at one scale. [N, 2]"""
    low, high = places.min(axis=0), places.max(axis=0)
    room = np.array([box.width, box.height]) - 2 * MARGIN
    scale = float(np.min(room / np.maximum(high - low, 1e-9 * max(1.0, float(np.abs(places).max())))))
    return np.array(box.center) + (places - (low + high) / 2) * min(scale, 1e12)


def draw_map(report: CaptureReport, holdout: frozenset[str], box: Rect, ui: UiState, pointed: str | None) -> str | None:
    """Draw it into a box.

    Args:
        pointed: Name of the camera that stands out, as in the list next to the map.
    Returns:
        The camera that was clicked, None without a click.
    """
    draw = imgui.get_window_draw_list()
    draw.add_rect_filled(box.low, box.high, theme.u32(theme.BACKDROP), 4)
    imgui.set_cursor_screen_pos(box.low)
    is_clicked = imgui.invisible_button("##map", ImVec2(box.width, box.height))
    is_hovered = imgui.is_item_hovered()
    ui.mark("opening.map")
    places, looks = seen_from_above(report)
    points = placed(places, box)
    focus = points[-1]
    draw.add_circle(ImVec2(*focus), 3.0, theme.u32(theme.TEXT_DIM), 0, 1.5)
    pointer = imgui.get_mouse_pos()
    distances = np.linalg.norm(points[:-1] - (pointer.x, pointer.y), axis=1)
    nearest = int(np.argmin(distances))
    under = nearest if is_hovered and distances[nearest] < REACH else None
    for row, camera in enumerate(report.cameras):
        x, y = points[row]
        is_out = camera.name in holdout
        color = theme.u32(theme.HELD_OUT if is_out else theme.SKY)
        length = max(float(np.linalg.norm(looks[row])), 1e-9)
        dx, dy = looks[row] * (LOOK_LENGTH / max(length, 0.2))
        draw.add_line(ImVec2(x, y), ImVec2(x + dx, y + dy), color, 1.5)
        if is_out:  # distinguished by their shape, too
            draw.add_rect_filled(ImVec2(x - DOT, y - DOT), ImVec2(x + DOT, y + DOT), theme.u32(theme.BACKDROP))
            draw.add_rect(ImVec2(x - DOT, y - DOT), ImVec2(x + DOT, y + DOT), color, 0.0, 2.0)
        else:
            draw.add_circle_filled(ImVec2(x, y), DOT, color)
        if row == under or camera.name == pointed:
            draw.add_circle(ImVec2(x, y), DOT + 4, theme.u32(theme.TEXT), 0, 1.5)
    if under is None:
        return None
    name = report.cameras[under].name
    imgui.set_tooltip(f"{name}{', held out' if name in holdout else ''}")
    return name if is_clicked else None
