"""Painting with the pointer over the picture of a camera, for the item drawn last, the picture's button."""

from __future__ import annotations

from imgui_bundle import imgui

from app.session.session_view import SessionView
from ui.panels.picture.pointer import Pointer
from ui.panels.state import Dispatch, Rect, UiState

DRAG = "mask"
"""Of Pointer.drag: the brush has taken the press."""


def follow_brush(session: SessionView, dispatch: Dispatch, ui: UiState, pointer: Pointer, pane: Rect) -> None:
    """Take up what the pointer did since the last frame. The brush is laid down when the camera is left.

    Args:
        pane: Where the picture of the camera lies.
    """
    tool, io = ui.masks, imgui.get_io()
    if not tool.is_active:
        return
    if session.view.look_through != tool.camera_index:
        tool.stop()
        return
    x = (io.mouse_pos.x - pane.x0) / max(pane.width, 1.0)
    y = (io.mouse_pos.y - pane.y0) / max(pane.height, 1.0)
    if imgui.is_item_hovered() and io.key_ctrl and io.mouse_wheel:
        tool.resize(io.mouse_wheel)
    if pointer.drag == DRAG:
        tool.extend(x, y)
        ui.redraw_within(0.0)
        if imgui.is_item_deactivated():
            timeline = session.timeline
            command = tool.take_stroke(timeline.frame_index, timeline.clip, timeline.n_frames)
            if command is not None:
                dispatch(command)
        return
    is_pressed = imgui.is_item_activated() and pointer.button == imgui.MouseButton_.left
    if is_pressed and pane.contains(io.mouse_pos.x, io.mouse_pos.y):
        pointer.take_press(DRAG)
        tool.is_erasing, tool.points = io.key_shift, []
        tool.extend(x, y)
