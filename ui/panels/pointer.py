"""What the pointer does over the picture: it turns presses, drags and the wheel into changes of the view."""

from __future__ import annotations

import time

from imgui_bundle import ImVec2, imgui

from app.session.commands import LookThrough
from ui.panels.actions.action import ActionNeeds
from ui.panels.panes import Panes
from ui.panels.state import Dispatch, UiState
from ui.viewport.region_tool import GROWTH

MOVING_S = 0.22
"""The view counts as moving for this long after the last change of it."""
WIPE_GRAB_PX = 9.0
CLICK_PX = 4.0
"""A press that moves less than this before its release is a click, where clicks mean something."""


class Pointer:
    """The press and drag in progress over one picture.

    Attributes:
        drag: What is being dragged: "view", "wipe", or "turn" once a press that could have been a click has moved;
            None while nothing is.
        button: imgui.MouseButton_ of the press.
        pressed_at: Where it was pressed, logical pixels.
        pressed_camera: The camera whose pyramid was pressed, until the release or a drag.
        is_click: A place was clicked in this frame while a region is chosen.
    """

    def __init__(self) -> None:
        self.drag: str | None = None
        self.button: int = 0
        self.pressed_at = (0.0, 0.0)
        self.pressed_camera: int | None = None
        self.is_click = False
        self._moved_s = -1e9

    @property
    def is_moving(self) -> bool:
        """Did the view change a moment ago?"""
        return time.perf_counter() - self._moved_s < MOVING_S

    def note_moved(self) -> None:
        """The view was changed, by the pointer or by something else."""
        self._moved_s = time.perf_counter()

    def take_click(self) -> bool:
        """Was a place clicked? Once."""
        is_click, self.is_click = self.is_click, False
        return is_click

    def navigate(self, session: ActionNeeds, dispatch: Dispatch, ui: UiState, panes: Panes) -> None:
        """Take up what the pointer did since the last frame. The picture's item was submitted last."""
        io = imgui.get_io()
        view, tool = session.view, ui.regions
        if imgui.is_item_hovered() and io.mouse_wheel != 0.0:
            if tool.sphere is not None and not io.key_ctrl:
                tool.set_radius(tool.radius * GROWTH**io.mouse_wheel)
            else:
                _leave_camera(session, dispatch)
                view.dolly(0.9**io.mouse_wheel)
                self.note_moved()
        if imgui.is_item_activated():
            self.pressed_at = (io.mouse_pos.x, io.mouse_pos.y)
            buttons = (imgui.MouseButton_.left, imgui.MouseButton_.right, imgui.MouseButton_.middle)
            self.button = next((button for button in buttons if imgui.is_mouse_down(button)), buttons[0])
            self.drag = "wipe" if _is_on_wipe(session, panes, io.mouse_pos) else "view"
            return  # the pointer's way to where it was pressed is not a drag
        # The last stretch of a quick drag arrives in the same frame as the release, when the item is active no more.
        is_dragged = imgui.is_item_active() or (imgui.is_item_deactivated() and self.drag is not None)
        if not is_dragged:
            self.drag = None
            if imgui.is_item_hovered() and _is_on_wipe(session, panes, io.mouse_pos):
                imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew)
            return
        if self.drag == "wipe":
            share = (io.mouse_pos.x - panes.rendered.x0) / max(panes.rendered.width, 1.0)
            session.overlays.wipe_position = min(max(share, 0.0), 1.0)
            imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew)
            return
        if self.pressed_camera is not None:
            x, y = self.pressed_at
            if max(abs(io.mouse_pos.x - x), abs(io.mouse_pos.y - y)) < CLICK_PX:
                if imgui.is_item_deactivated():
                    dispatch(LookThrough(self.pressed_camera))
                return
            self.pressed_camera = None  # it became a drag
        if tool.is_active and self.button == imgui.MouseButton_.left and self.drag == "view":
            x, y = self.pressed_at
            if max(abs(io.mouse_pos.x - x), abs(io.mouse_pos.y - y)) < CLICK_PX:
                self.is_click = imgui.is_item_deactivated()
                return
            self.drag = "turn"  # from here on it is not a click, even if it comes back
        dx, dy = io.mouse_delta.x, io.mouse_delta.y
        if dx == 0.0 and dy == 0.0:
            return
        _leave_camera(session, dispatch)
        is_middle = self.button == imgui.MouseButton_.middle
        if self.button == imgui.MouseButton_.right or (is_middle and io.key_shift):
            view.pan(dx, dy)
        elif is_middle and io.key_ctrl:
            view.dolly(1.01**dy)
        else:
            view.orbit(dx, dy)
        self.note_moved()


def _leave_camera(session: ActionNeeds, dispatch: Dispatch) -> None:
    if session.view.look_through is not None:
        dispatch(LookThrough(None))


def _is_on_wipe(session: ActionNeeds, panes: Panes, pointer: ImVec2) -> bool:
    if session.overlays.compare != "wipe" or panes.captured is None:
        return False
    x = panes.rendered.x0 + panes.rendered.width * session.overlays.wipe_position
    return abs(pointer.x - x) <= WIPE_GRAB_PX and panes.rendered.y0 <= pointer.y <= panes.rendered.y1
