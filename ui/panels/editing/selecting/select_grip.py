"""Selecting with the pointer over one picture: presses that a tool takes, what they draw, and the command in the end.

For the item drawn last, the picture's button.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from imgui_bundle import imgui

from app.session.editing.selection_commands import SelectAnchor, SelectVolume
from app.session.session_view import SessionView
from engine.editing.actions import vector_of
from engine.editing.selection.seen_from import SeenFrom
from engine.editing.selection.set_algebra import SelectMode
from engine.editing.volumes.prisms import depths_under
from ui.panels.picture.pointer import Pointer
from ui.panels.state import Dispatch, Rect, UiState
from ui.viewport.editing.select_tool import SelectTool
from ui.viewport.scene import SceneView

DRAG = "select"
"""Of Pointer.drag: a tool that selects has taken the press."""
Pick = Callable[[float, float], np.ndarray | None]


class SelectGrip:
    """Leads the tool in one picture."""

    def __init__(self) -> None:
        self._has_drag = False  # there may be other pictures

    def follow(
        self,
        session: SessionView,
        dispatch: Dispatch,
        ui: UiState,
        pointer: Pointer,
        view: SceneView,
        pane: Rect,
        density: float,
        pick: Pick,
        spacing: float,
    ) -> None:
        """Take up what the pointer did since the last frame.

        Args:
            pick: The place that is seen at a point of the window.
            spacing: Distance between anchors, scene units.
        """
        tool, (x, y) = ui.selecting, _pointer()
        if tool.is_active and imgui.is_item_hovered() and pane.contains(x, y):
            self._turn_wheel(dispatch, tool)
        if pointer.drag == DRAG:
            if not tool.is_dragging:  # Escape has ended it
                return
            pointer.is_beyond_click()  # noted on the way: a lasso ends where it began
            tool.extend(x, y)
            ui.redraw_within(0.0)
            if imgui.is_item_deactivated():
                self._finish(session, dispatch, tool, pointer, view, pane, density, pick, spacing)
            return
        if self._has_drag and tool.is_dragging:  # somebody has taken the pointer away
            tool.points, tool.surface = [], None
        self._has_drag = False
        is_pressed = imgui.is_item_activated() and pointer.button == imgui.MouseButton_.left
        if tool.is_active and is_pressed and pointer.drag in ("view", "nothing") and pane.contains(x, y):
            pointer.take_press(DRAG)
            self._has_drag = True
            tool.begin(*pointer.pressed_at, _mode(tool), pick(*pointer.pressed_at) if _needs_surface(tool) else None)

    def _finish(
        self,
        session: SessionView,
        dispatch: Dispatch,
        tool: SelectTool,
        pointer: Pointer,
        view: SceneView,
        pane: Rect,
        density: float,
        pick: Pick,
        spacing: float,
    ) -> None:
        up = np.asarray(session.view.up, np.float64)
        seen = view.seen_from
        depths_of = partial(_depths, session, seen)
        command = tool.command(seen, (pane.x0, pane.y0), density, up, spacing, depths_of)
        mode, tool.points, tool.surface = tool.held_mode, [], None
        if tool.kind in ("rectangle", "lasso", "prism") and not pointer.is_beyond_click():
            place = pick(*pointer.pressed_at)  # a click means an anchor
            command = None if place is None else SelectAnchor(vector_of(place), tool.how(mode))
        if command is not None:
            dispatch(command)

    def _turn_wheel(self, dispatch: Dispatch, tool: SelectTool) -> None:
        io = imgui.get_io()
        if io.mouse_wheel and io.key_ctrl and tool.resize(io.mouse_wheel) and tool.volume is not None:
            dispatch(SelectVolume(tool.volume, tool.how(), tool.is_by_extent))


def _depths(session: SessionView, view: SeenFrom, pixels: np.ndarray) -> tuple[float, float] | None:
    """From where to where the shown Gaussians under a loop reach; None where there are none."""
    gaussians = session.shown_gaussians()
    return None if gaussians is None else depths_under(pixels, gaussians.means, gaussians.opacities, view)


def _needs_surface(tool: SelectTool) -> bool:
    return tool.kind in ("box", "sphere", "flood")


def _mode(tool: SelectTool) -> SelectMode:
    io = imgui.get_io()
    return tool.mode_held(is_shift=io.key_shift, is_ctrl=io.key_ctrl, is_alt=io.key_alt)


def _pointer() -> tuple[float, float]:
    position = imgui.get_io().mouse_pos
    return position.x, position.y
