"""Input by pointer and held keys over one picture: presses, drags, the wheel and flying, as changes of the view.

Which gesture a button or the wheel makes is looked up in the preset in use (ui.panels.picture.gestures).
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from imgui_bundle import ImVec2, imgui

from app.playback.views.orbit_view import OrbitView
from app.session.session_view import SessionView
from app.session.showing.look_commands import LookThrough
from ui.panels.picture.flying import Flying
from ui.panels.picture.gestures import Button, Gesture, modifier_words
from ui.panels.picture.gizmo import gizmo_rect, tip_under
from ui.panels.picture.panes import Panes
from ui.panels.state import Dispatch, Rect, UiState
from ui.viewport.editing.select_tool import SIZED
from ui.viewport.region_tool import GROWTH

MOVING_S = 0.22
"""The view counts as moving for this long after the last change of it."""
WIPE_GRAB_PX = 9.0
CLICK_PX = 4.0
"""A press that moves less than this before its release is a click, where clicks mean something."""
DOLLY_PER_STEP, DOLLY_PER_PX, LENS_PER_STEP = 0.9, 1.01, 0.95
"""Factors of a step of the wheel, and of a pixel of a drag. Touchpads send parts of a step."""
PX_PER_STEP = 40.0
"""A step of the wheel orbits or moves sideways as a drag of so many pixels does."""
ROLL_PER_PX = 0.006
AIM_AGAIN_S = 0.6
"""Steps of the wheel that follow each other at one place move towards the same point."""
_BUTTONS: dict[int, Button] = {
    int(imgui.MouseButton_.left): "Left",
    int(imgui.MouseButton_.right): "Right",
    int(imgui.MouseButton_.middle): "Middle",
}

Pick = Callable[[float, float], np.ndarray | None]
"""The place of the scene that is seen at a point of the window; None where there is nothing. Scene units, [3]"""


class Pointer:
    """The press and drag in progress over one picture.

    Attributes:
        drag: The thing being dragged: "view", "wipe", "gizmo", "nothing" after a double click, "turn" once a press
            that could have been a click has moved, or what somebody else took the press for; None while nothing is.
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
        self._flying = Flying()
        self._moved_s = -1e9
        self._gesture: Gesture = "none"
        self._has_moved = False
        self._center: np.ndarray | None = None
        self._wheel_aim: tuple[tuple[float, float], np.ndarray | None, float] | None = None
        self._is_click_taken = False

    @property
    def is_moving(self) -> bool:
        """Did the view change a moment ago?"""
        return time.perf_counter() - self._moved_s < MOVING_S

    def note_moved(self) -> None:
        """The view was changed, by the pointer or by something else."""
        self._moved_s = time.perf_counter()

    def take_press(self, drag: str) -> None:
        """The press of this frame was on something that somebody else drags; nor is a second click meant for what lies
        behind that."""
        self.drag, self.pressed_camera, self._is_click_taken = drag, None, True

    def take_click(self) -> bool:
        """Was a place clicked? Once."""
        is_click, self.is_click = self.is_click, False
        return is_click

    def navigate(
        self,
        session: SessionView,
        dispatch: Dispatch,
        ui: UiState,
        panes: Panes,
        area: Rect,
        pick: Pick,
        *,
        is_active: bool = True,
    ) -> None:
        """Take up what pointer and keys did since the last frame. The picture's item was submitted last.

        Args:
            area: Everything that belongs to the view.
            is_active: Whether keys that are held fly in this view.
        """
        view = session.view
        view.is_eased = not ui.navigation.is_motion_reduced
        was_moving = view.is_moving
        if view.advance(imgui.get_io().delta_time) or was_moving:
            self._show_move(ui)
        if is_active and self._flying.follow(session, dispatch, ui):
            self._show_move(ui)
        if imgui.is_item_hovered():
            self._turn_wheel(session, dispatch, ui, pick)
        if imgui.is_item_activated():
            self._press(session, dispatch, ui, panes, area, pick)
            return  # the pointer's way to where it was pressed is not a drag
        # The last stretch of a quick drag arrives in the same frame as the release, when the item is active no more.
        is_dragged = imgui.is_item_active() or (imgui.is_item_deactivated() and self.drag is not None)
        if is_dragged:
            self._drag(session, dispatch, ui, panes, area, pick)
            return
        self.drag = None
        if imgui.is_item_hovered() and _is_on_wipe(session, panes, imgui.get_io().mouse_pos):
            imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew)

    def _show_move(self, ui: UiState) -> None:
        self.note_moved()
        ui.redraw_within(0.0)

    # ---- the wheel -------------------------------------------------------------------------------------------

    def _turn_wheel(self, session: SessionView, dispatch: Dispatch, ui: UiState, pick: Pick) -> None:
        io, tool, view = imgui.get_io(), ui.regions, session.view
        across, steps = io.mouse_wheel_h, io.mouse_wheel
        if across == 0.0 and steps == 0.0:
            return
        gesture = ui.navigation.preset.turn(_modifiers())
        if io.key_ctrl and (ui.masks.is_active or (ui.selecting.is_active and ui.selecting.kind in SIZED)):
            return  # it is meant for the tool
        if tool.sphere is not None:
            if not io.key_ctrl:
                tool.set_radius(tool.radius * GROWTH**steps)
                return
            gesture = "dolly"
        at = (io.mouse_pos.x, io.mouse_pos.y)
        point = self._aim_of_wheel(at, pick) if gesture in ("dolly", "orbit") else None
        _leave_camera(session, dispatch)
        if gesture == "dolly":
            view.dolly(DOLLY_PER_STEP**steps, point)
        elif gesture == "lens":
            view.set_fov(view.fov_y * LENS_PER_STEP**steps)
        elif gesture == "orbit":
            view.orbit(PX_PER_STEP * across, PX_PER_STEP * steps, point)
        elif gesture == "pan":
            # Shift turns a wheel that has one axis only into the other one.
            is_across = across == 0.0 and io.key_shift
            step = PX_PER_STEP * io.display_framebuffer_scale.x
            view.pan(step * (steps if is_across else across), 0.0 if is_across else step * steps)
        self.note_moved()

    def _aim_of_wheel(self, at: tuple[float, float], pick: Pick) -> np.ndarray | None:
        """The point under the pointer when the wheel began to turn here: a point that comes nearer must not be left for
        another one behind it."""
        now_s = time.perf_counter()
        if self._wheel_aim is not None and self._wheel_aim[0] == at and now_s - self._wheel_aim[2] < AIM_AGAIN_S:
            point = self._wheel_aim[1]
        else:
            point = pick(*at)
        self._wheel_aim = (at, point, now_s)
        return point

    # ---- buttons ---------------------------------------------------------------------------------------------

    def _press(
        self, session: SessionView, dispatch: Dispatch, ui: UiState, panes: Panes, area: Rect, pick: Pick
    ) -> None:
        io = imgui.get_io()
        self.pressed_at = (io.mouse_pos.x, io.mouse_pos.y)
        self.button = next((button for button in _BUTTONS if imgui.is_mouse_down(button)), int(imgui.MouseButton_.left))
        self._gesture = ui.navigation.preset.drag(_BUTTONS[self.button], _modifiers())
        self._has_moved, self._center = False, None
        is_left = self.button == int(imgui.MouseButton_.left)
        is_second = is_left and imgui.is_mouse_double_clicked(imgui.MouseButton_.left)
        rect = gizmo_rect(area) if panes.captured is None else None
        self.drag = "view"
        if _is_on_wipe(session, panes, io.mouse_pos):
            self.drag = "wipe"
        elif is_left and rect is not None and rect.contains(*self.pressed_at):
            self.drag = "gizmo"
        elif is_second and not (ui.regions.is_active or ui.selecting.is_active):
            point = None if self._is_click_taken else pick(*self.pressed_at)
            if point is not None:
                self.drag = "nothing"
                session.view.focus_on(point)
                self._show_move(ui)
        if not is_second:
            self._is_click_taken = False

    def _drag(
        self, session: SessionView, dispatch: Dispatch, ui: UiState, panes: Panes, area: Rect, pick: Pick
    ) -> None:
        io, tool = imgui.get_io(), ui.regions
        is_over = imgui.is_item_deactivated()
        if self.drag == "wipe":
            share = (io.mouse_pos.x - panes.rendered.x0) / max(panes.rendered.width, 1.0)
            session.overlays.wipe_position = min(max(share, 0.0), 1.0)
            imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew)
            return
        if self.drag not in ("view", "gizmo", "turn"):
            return
        if self.drag == "gizmo" and not self.is_beyond_click():
            rect = gizmo_rect(area)
            tip = None if rect is None else tip_under(session.view, rect, *self.pressed_at)
            if is_over and tip is not None:
                session.view.look_along(tip.name)
                self._show_move(ui)
            return
        if self.pressed_camera is not None:
            if not self.is_beyond_click():
                if is_over:
                    self._is_click_taken = True
                    dispatch(LookThrough(self.pressed_camera))
                return
            self.pressed_camera = None  # it became a drag
        if tool.is_active and self.button == int(imgui.MouseButton_.left) and self.drag == "view":
            if not self.is_beyond_click():
                self.is_click = is_over
                return
            self.drag = "turn"  # from here on it is not a click, even if it comes back
        if io.mouse_delta.x != 0.0 or io.mouse_delta.y != 0.0:
            self._move_view(session, dispatch, ui, pick, io.mouse_delta.x, io.mouse_delta.y)

    def is_beyond_click(self) -> bool:
        """Has the press become a drag? It stays one when it comes back."""
        pointer, (x, y) = imgui.get_io().mouse_pos, self.pressed_at
        self._has_moved |= max(abs(pointer.x - x), abs(pointer.y - y)) >= CLICK_PX
        return self._has_moved

    def _move_view(
        self, session: SessionView, dispatch: Dispatch, ui: UiState, pick: Pick, dx: float, dy: float
    ) -> None:
        """A stretch of a drag. The first one finds what the view turns about: what was under the press."""
        view, gesture = session.view, self._gesture
        is_flying = self._flying.is_flying
        if self.drag == "gizmo":
            gesture = "orbit"
        elif is_flying:
            gesture = ui.navigation.preset.drag(_BUTTONS[self.button], _modifiers(), is_flying=True)
        if gesture == "none":
            return
        if self._center is None and self.drag != "gizmo" and gesture in ("orbit", "pan", "dolly"):
            point = pick(*self.pressed_at)
            _leave_camera(session, dispatch)
            if point is not None and not is_flying:
                view.take_pivot(point)
            self._center = view.pivot.copy() if point is None else point
        _leave_camera(session, dispatch)
        _apply(gesture, view, dx, dy, self._center)
        self.note_moved()


def _apply(gesture: Gesture, view: OrbitView, dx: float, dy: float, center: np.ndarray | None) -> None:
    """Carry out a stretch of a drag, in logical pixels."""
    density = imgui.get_io().display_framebuffer_scale.x
    if gesture == "orbit":
        view.orbit(dx, dy, center)
    elif gesture == "pan":
        view.pan(density * dx, density * dy)
    elif gesture == "dolly":
        view.dolly(DOLLY_PER_PX**dy, center)
    elif gesture == "look":
        view.look_around(density * dx, density * dy)
    elif gesture == "roll":
        view.lean(ROLL_PER_PX * dx)
    elif gesture == "lens":
        view.set_fov(view.fov_y / LENS_PER_STEP ** (dy / PX_PER_STEP))


def _modifiers() -> str:
    io = imgui.get_io()
    return modifier_words(is_ctrl=io.key_ctrl, is_shift=io.key_shift, is_alt=io.key_alt)


def _leave_camera(session: SessionView, dispatch: Dispatch) -> None:
    if session.view.look_through is not None:
        dispatch(LookThrough(None))


def _is_on_wipe(session: SessionView, panes: Panes, pointer: ImVec2) -> bool:
    if session.overlays.compare != "wipe" or panes.captured is None:
        return False
    x = panes.rendered.x0 + panes.rendered.width * session.overlays.wipe_position
    return abs(pointer.x - x) <= WIPE_GRAB_PX and panes.rendered.y0 <= pointer.y <= panes.rendered.y1
