"""Handles of what is edited under the pointer, over one picture: held, dragged, and given back with Escape; and points
of the scene that are asked for.

The window's own handles and not ImGuizmo's: those take no press over an item, and the picture is one; nor do they
distinguish a press on them from one next to them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from imgui_bundle import imgui

from app.playback.views.scene_axes import rig_radius
from app.session.editing.edit_commands import SetScaleByLength, SetUpByGround, Undo
from app.session.editing.selection_commands import InvertSelection, SelectVolume
from app.session.session_view import SessionView
from engine.editing.actions import Transform, vector_of
from ui.panels.editing.edit_subject import Subject, subject_of
from ui.panels.picture.pointer import Pointer
from ui.panels.state import Dispatch, Rect, UiState
from ui.viewport.editing.edit_tool import N_ASKED, EditTool
from ui.viewport.editing.handles import HandleView, dragged, handle_under, snap_step
from ui.viewport.scene import SceneView

DRAG = "edit"
"""Of Pointer.drag: a handle was pressed."""
REACH = 11.0
"""How near to a handle the pointer has to be; units."""
Pick = Callable[[float, float], np.ndarray | None]


class EditGrip:
    """Leads the handles in one picture. For the item drawn last, the picture's button."""

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
    ) -> None:
        """Take up what the pointer did since the last frame. pick: The place that is seen at a point of the window."""
        tool, subject = ui.editing, subject_of(session, ui)
        tool.follow(session.edits.edits)
        if tool.asking is not None:
            self._take_point(session, dispatch, ui, pointer, pane, pick)
            return
        x, y = _pointer()
        at, lens = ((x - pane.x0) * density, (y - pane.y0) * density), lens_of(view, density)
        if pointer.drag == DRAG and tool.held is not None:
            self._drag(session, dispatch, ui, pointer, subject, lens, at)
            return
        if pointer.drag is None:
            tool.release()
        tool.pointed = None
        is_pressed = imgui.is_item_activated() and pointer.button == imgui.MouseButton_.left
        is_resting = pointer.drag is None and not pointer.is_moving
        is_free = imgui.is_item_hovered() and not ui.regions.is_active and pane.contains(x, y)
        can_edit = subject is not None and (subject.edit is None or session.edits.can_edit)
        if subject is None or not can_edit or not is_free or not (is_resting or is_pressed):
            return
        tool.pointed = handle_under(subject.thing, lens, *at, reach_px=REACH * density)
        if tool.pointed is None:
            return
        imgui.set_mouse_cursor(imgui.MouseCursor_.hand)
        if is_pressed and pointer.drag != "wipe":
            pointer.take_press(DRAG)
            tool.hold(tool.pointed, subject.thing, at)

    def _drag(
        self,
        session: SessionView,
        dispatch: Dispatch,
        ui: UiState,
        pointer: Pointer,
        subject: Subject | None,
        lens: HandleView,
        at: tuple[float, float],
    ) -> None:
        tool, io = ui.editing, imgui.get_io()
        handle, before = tool.held, tool.held_thing
        if handle is None or before is None or subject is None or type(subject.thing) is not type(before):
            tool.release()
            return
        tool.pointed = handle
        imgui.set_mouse_cursor(imgui.MouseCursor_.resize_all)
        if imgui.is_key_pressed(imgui.Key.escape, False):
            self._give_back(dispatch, ui, subject)
            return
        if pointer.is_beyond_click():
            step = snap_step(rig_radius(session.rig) if len(session.rig) else 1.0) if io.key_ctrl else 0.0
            after = dragged(before, handle, lens, tool.held_at, at, step=step, is_whole=io.key_shift)
            if after != subject.thing:
                self._put(dispatch, ui, subject, after)
                tool.has_dragged = True
        if imgui.is_item_deactivated():
            if tool.has_dragged and subject.edit is None:
                select_drawn(dispatch, ui)
            tool.release()

    def _put(self, dispatch: Dispatch, ui: UiState, subject: Subject, after: object) -> None:
        if subject.edit is None:
            assert not isinstance(after, Transform)
            ui.selecting.volume = after  # type: ignore[assignment]
            ui.redraw_within(0.0)
            return
        assert ui.editing.held is not None
        command = subject.with_thing(after, ui.editing.gesture, ui.editing.held.verb)  # type: ignore[arg-type]
        assert command is not None
        dispatch(command)

    def _give_back(self, dispatch: Dispatch, ui: UiState, subject: Subject) -> None:
        """Escape: as if the handle had not been touched."""
        tool = ui.editing
        if tool.has_dragged and subject.edit is not None:
            dispatch(Undo())
        elif tool.held_thing is not None and not isinstance(tool.held_thing, Transform) and subject.edit is None:
            ui.selecting.volume = tool.held_thing
        tool.release()

    def _take_point(
        self, session: SessionView, dispatch: Dispatch, ui: UiState, pointer: Pointer, pane: Rect, pick: Pick
    ) -> None:
        """A click, not a drag, gives a point; enough of them say what was asked for."""
        tool = ui.editing
        if imgui.is_item_hovered():
            imgui.set_mouse_cursor(imgui.MouseCursor_.hand)
        is_click = imgui.is_item_deactivated() and pointer.button == imgui.MouseButton_.left
        if tool.asking is None or not is_click or pointer.is_beyond_click() or not pane.contains(*pointer.pressed_at):
            return
        point = pick(*pointer.pressed_at)
        if point is None:
            return
        tool.points.append(np.asarray(point, np.float64))
        if len(tool.points) == N_ASKED[tool.asking]:
            command = _given(session, tool)
            tool.ask(None)
            dispatch(command)


def _given(session: SessionView, tool: EditTool) -> SetUpByGround | SetScaleByLength:
    """The command from enough points."""
    points = [vector_of(point) for point in tool.points]
    if tool.asking == "length":
        return SetScaleByLength(points[0], points[1], tool.length_m)
    return SetUpByGround((points[0], points[1], points[2]), vector_of(session.rig.centers.mean(axis=0)))


def select_drawn(dispatch: Dispatch, ui: UiState) -> None:
    """Select the contents of the drawn volume as it is now."""
    if ui.selecting.volume is not None:
        dispatch(SelectVolume(ui.selecting.volume, ui.selecting.how(), ui.selecting.is_by_extent))
        if ui.editing.is_outside:
            dispatch(InvertSelection())


def lens_of(view: SceneView, density: float) -> HandleView:
    """A view of the window as handles know it."""
    return HandleView(view.world_to_camera, view.K, max(view.near, 1e-6), density)


def _pointer() -> tuple[float, float]:
    position = imgui.get_io().mouse_pos
    return position.x, position.y
