"""Keys of the camera path under the pointer, over one picture: chosen by a click, moved by a drag, gone to by a double
click.
"""

from __future__ import annotations

from imgui_bundle import imgui

from app.session.paths.path_commands import ChooseCameraKey
from app.session.session_view import SessionView
from ui.panels.picture.pointer import Pointer
from ui.panels.state import Dispatch, Rect, UiState
from ui.viewport.layers.path_layer import PathLayer
from ui.viewport.path_tool import moved_in_view
from ui.viewport.scene import SceneView

DRAG = "key"
"""Of Pointer.drag: a key of the path was pressed."""


def choose_key(dispatch: Dispatch, ui: UiState, index: int | None, *, is_going: bool = False) -> None:
    """Let a key stand out; Delete is then meant for it, and for no region."""
    ui.regions.highlighted = None
    dispatch(ChooseCameraKey(index, is_going=is_going))


class KeyGrip:
    """The drag of a key in progress over one picture. For the item drawn last, the picture's button."""

    def __init__(self) -> None:
        self._at = (0.0, 0.0)

    def follow(
        self,
        session: SessionView,
        dispatch: Dispatch,
        ui: UiState,
        layer: PathLayer,
        pointer: Pointer,
        view: SceneView,
        pane: Rect,
        density: float,
    ) -> None:
        """Take up what the pointer did since the last frame."""
        if pointer.drag == DRAG and ui.paths.dragged is not None:
            self._drag(session, dispatch, ui, pointer, view, density)
            layer.pointed_key = ui.paths.dragged
            imgui.set_mouse_cursor(imgui.MouseCursor_.resize_all)
            if imgui.is_item_deactivated():
                ui.paths.dragged = None
            return
        if pointer.drag is None:
            ui.paths.dragged = None
        is_pressed = imgui.is_item_activated() and pointer.button == imgui.MouseButton_.left
        is_choosing = ui.regions.is_active or ui.selecting.is_active
        is_free = imgui.is_item_hovered() and not is_choosing and pane.contains(*_pointer())
        is_resting = pointer.drag is None and not pointer.is_moving
        layer.pointed_key = None
        if is_free and (is_resting or (is_pressed and pointer.drag != "wipe")):
            x, y = _pointer()
            layer.pointed_key = layer.key_under(session, view, (x - pane.x0) * density, (y - pane.y0) * density)
        if layer.pointed_key is None:
            return
        imgui.set_mouse_cursor(imgui.MouseCursor_.hand)
        if is_pressed:
            self._press(dispatch, ui, pointer, layer.pointed_key)

    def _press(self, dispatch: Dispatch, ui: UiState, pointer: Pointer, index: int) -> None:
        pointer.take_press(DRAG)
        self._at = pointer.pressed_at
        ui.paths.dragged = index
        ui.paths.begin_gesture()
        choose_key(dispatch, ui, index, is_going=imgui.is_mouse_double_clicked(imgui.MouseButton_.left))

    def _drag(
        self, session: SessionView, dispatch: Dispatch, ui: UiState, pointer: Pointer, view: SceneView, density: float
    ) -> None:
        path, index, (x, y) = session.paths.path, ui.paths.dragged, _pointer()
        if path is None or index is None or index >= len(path.keys) or not session.paths.can_edit:
            return
        dx, dy = density * (x - self._at[0]), density * (y - self._at[1])
        if not pointer.is_beyond_click() or (dx, dy) == (0.0, 0.0):
            return
        self._at = (x, y)
        is_along_view = imgui.get_io().key_ctrl
        command = moved_in_view(
            index,
            path.keys[index],
            view.world_to_camera,
            view.K,
            dx,
            dy,
            is_along_view=is_along_view,
            gesture=ui.paths.gesture,
        )
        if command is not None:
            dispatch(command)


def _pointer() -> tuple[float, float]:
    position = imgui.get_io().mouse_pos
    return position.x, position.y
