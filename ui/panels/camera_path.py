"""The panel of camera paths: which there are, the keys of the chosen one, and what can be done with them."""

from __future__ import annotations

import math

from imgui_bundle import ImVec2, imgui

from app.document.camera_paths import MAX_NAME_CHARACTERS
from app.session.edit_status import PathsStatus
from app.session.paths.path_commands import (
    AimCameraKey,
    ChooseCameraPath,
    CloseCameraPath,
    DeleteCameraKey,
    DeleteCameraPath,
    LookAlongPath,
    MakeFlyThrough,
    MakeTurntable,
    NewCameraPath,
    RenameCameraPath,
    SetCameraKey,
    SetCameraKeyFov,
    TimeCameraKey,
)
from app.session.session_view import SessionView
from engine.camera.camera_path import CameraPath
from engine.text import one_line
from ui.panels.picture.key_grip import choose_key
from ui.panels.pieces.history_buttons import draw_history
from ui.panels.pieces.key_words import frame_words
from ui.panels.pieces.slider import slider
from ui.panels.pieces.widgets import elided, primary_button, segment, text_right, text_warning, text_wrapped_dim
from ui.panels.state import Dispatch, UiState
from ui.style.theme import Icon

MOST_PATH_ROWS, LEAST_KEY_ROWS = 5, 4
FOV_DEG = (2.0, 150.0)
"""Range of the slider for the lens."""
LABEL_WIDTH, BUTTON_WIDTH = 54.0, 36.0
ROWS_BELOW = 4.5
"""Room for widgets below the list of keys, in rows of buttons."""


def draw_paths(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Making paths, the list, the keys of the chosen one, the way back."""
    status = session.paths
    if session.capture is None:
        text_wrapped_dim("Camera paths appear here once a capture is open.")
        return
    imgui.begin_disabled(not status.can_edit)
    _draw_making(status, dispatch, ui)
    imgui.end_disabled()
    if status.why_not:
        text_warning(status.why_not)
    if status.path is None:
        text_wrapped_dim(
            "A camera path films the scene: each key is a view at a frame, and the camera moves smoothly between keys."
        )
    else:
        _draw_list(status, dispatch, ui)
        _draw_path(status, status.path, dispatch, ui)
        imgui.separator()
        _draw_keys(status, status.path, dispatch, ui)
        _draw_key(status, dispatch, ui)
    draw_history(session.history, dispatch, ui, "paths")


def _draw_making(status: PathsStatus, dispatch: Dispatch, ui: UiState) -> None:
    width = imgui.get_content_region_avail().x
    if primary_button(f"{Icon.ADD}  Key from this view", ImVec2(width, 34), ui):
        dispatch(SetCameraKey())
    ui.mark("paths.key")
    words = "At the playhead; an existing key takes this view (C)"
    imgui.set_item_tooltip(
        f"A key of the path {words}" if status.path is not None else "Begins a path with a key at the playhead (C)"
    )
    made = (
        ("new", "New path", NewCameraPath(), "A path with a key at the playhead, from this view"),
        (
            "turntable",
            "Turntable",
            MakeTurntable(),
            "Once around the centre of this view over the played frames",
        ),
        ("fly_through", "Fly-through", MakeFlyThrough(), "From camera to camera over the played frames"),
    )
    for name, label, command, note in made:
        if _flowing_button(label):
            dispatch(command)
        ui.mark(f"paths.{name}")
        imgui.set_item_tooltip(note)


def _flowing_button(label: str, *, is_first: bool = False) -> bool:
    """A button next to the one before, or in the next line where there is no room for it."""
    style = imgui.get_style()
    right = imgui.get_cursor_screen_pos().x + imgui.get_content_region_avail().x
    width = imgui.calc_text_size(label, True).x + 2 * style.frame_padding.x
    if not is_first and imgui.get_item_rect_max().x + style.item_spacing.x + width <= right:
        imgui.same_line()
    return imgui.button(label)


def _draw_list(status: PathsStatus, dispatch: Dispatch, ui: UiState) -> None:
    if len(status.paths) == 1:
        return
    line = imgui.get_text_line_height_with_spacing()
    if imgui.begin_child("paths", ImVec2(0, min(len(status.paths), MOST_PATH_ROWS) * line + 4)):
        for row, path in enumerate(status.paths):
            imgui.push_id(row)
            is_clicked = imgui.selectable("##path", row == status.chosen)[0]
            ui.mark(f"paths.row{row}")
            imgui.same_line(0, 0)
            imgui.text(elided(one_line(path.name), imgui.get_content_region_avail().x - 70))
            text_right(_count_words(path))
            imgui.pop_id()
            if is_clicked and row != status.chosen:
                ui.paths.renamed = None
                dispatch(ChooseCameraPath(row))
    imgui.end_child()


def _count_words(path: CameraPath) -> str:
    return f"{len(path.keys)} key{'' if len(path.keys) == 1 else 's'}"


def _draw_path(status: PathsStatus, path: CameraPath, dispatch: Dispatch, ui: UiState) -> None:
    """Its name, and what belongs to all of it."""
    imgui.begin_disabled(not status.can_edit)
    width = imgui.get_content_region_avail().x
    imgui.set_next_item_width(width - BUTTON_WIDTH - imgui.get_style().item_spacing.x)
    flags = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all
    present = one_line(path.name)  # the box has one
    shown = present if ui.paths.renamed is None else ui.paths.renamed
    is_entered, typed = imgui.input_text("##name", shown, flags)
    ui.mark("paths.name")
    imgui.set_item_tooltip("The name of the path")
    if imgui.is_item_active():
        ui.paths.renamed = typed
    if is_entered or imgui.is_item_deactivated():
        ui.paths.renamed = None
        name = typed.strip()[:MAX_NAME_CHARACTERS]
        is_left = imgui.is_key_pressed(imgui.Key.escape, False)
        if name and name != present and not is_left:
            dispatch(RenameCameraPath(name))
    imgui.same_line()
    if imgui.button(f"{Icon.TRASH}##path", ImVec2(BUTTON_WIDTH, 0)):
        dispatch(DeleteCameraPath())
    ui.mark("paths.delete")
    imgui.end_disabled()
    imgui.set_item_tooltip("Delete this path; Undo brings it back")
    room = width - imgui.get_style().item_spacing.x
    if segment("Follow", status.is_along, 0.56 * room):
        dispatch(LookAlongPath(not status.is_along))
    ui.mark("paths.along")
    imgui.set_item_tooltip("The view follows the path until you move it (P)")
    imgui.same_line()
    imgui.begin_disabled(not status.can_edit)
    if segment(f"{Icon.LOOP}  Loop", path.is_closed, 0.44 * room):
        dispatch(CloseCameraPath(not path.is_closed))
    ui.mark("paths.loop")
    imgui.end_disabled()
    imgui.set_item_tooltip("The camera continues from the last key to the first")


def _draw_keys(status: PathsStatus, path: CameraPath, dispatch: Dispatch, ui: UiState) -> None:
    """One row per key in sight."""
    if not path.keys:
        text_wrapped_dim("The path has no keys yet.")
        return
    line = imgui.get_text_line_height_with_spacing()
    room = imgui.get_content_region_avail().y - ROWS_BELOW * imgui.get_frame_height_with_spacing()
    height = min(max(room, LEAST_KEY_ROWS * line), len(path.keys) * line + 6)
    if imgui.begin_child("keys", ImVec2(0, height)):
        clipper = imgui.ListClipper()
        clipper.begin(len(path.keys), line)
        while clipper.step():
            for index in range(clipper.display_start, clipper.display_end):
                _draw_key_row(status, path, index, dispatch, ui)
        clipper.end()
    imgui.end_child()


def _draw_key_row(status: PathsStatus, path: CameraPath, index: int, dispatch: Dispatch, ui: UiState) -> None:
    key = path.keys[index]
    imgui.push_id(index)
    flags = imgui.SelectableFlags_.allow_double_click
    if imgui.selectable("##key", index == status.chosen_key, flags)[0]:
        choose_key(dispatch, ui, index, is_going=imgui.is_mouse_double_clicked(imgui.MouseButton_.left))
    ui.mark(f"paths.key{index}")
    imgui.set_item_tooltip("Double-click to go there (Alt+Left, Alt+Right)")
    imgui.same_line(0, 0)
    imgui.text_disabled(f"{index + 1}")
    imgui.same_line(36)
    imgui.text(f"frame {frame_words(key.frame)}")
    text_right(f"{math.degrees(key.fov_y_rad):.1f}°")
    imgui.pop_id()


def _draw_key(status: PathsStatus, dispatch: Dispatch, ui: UiState) -> None:
    """The chosen key: when, through which lens, and what can be done with it."""
    key, index = status.key, status.chosen_key
    if key is None or index is None:
        text_wrapped_dim("Choose a key here, on the timeline or in the picture.")
        return
    imgui.begin_disabled(not status.can_edit)
    imgui.align_text_to_frame_padding()
    imgui.text("Frame")
    imgui.same_line(LABEL_WIDTH)
    imgui.set_next_item_width(-1)
    entering = imgui.InputTextFlags_.enter_returns_true
    is_edited, frame = imgui.input_float("##frame", key.frame, 1.0, 10.0, "%.2f", entering)
    ui.mark("paths.frame")
    if is_edited and frame != key.frame:
        dispatch(TimeCameraKey(index, frame, is_whole=False))
    imgui.set_item_tooltip("Press Enter to apply (Alt+Shift+Left, Alt+Shift+Right)")
    imgui.align_text_to_frame_padding()
    imgui.text("Lens")
    imgui.same_line(LABEL_WIDTH)
    words = "%.1f° high"
    imgui.set_next_item_width(-imgui.calc_text_size(words % 100.0).x - 8)
    flags = imgui.SliderFlags_.always_clamp | imgui.SliderFlags_.logarithmic
    is_edited, fov_deg = slider("##fov", math.degrees(key.fov_y_rad), *FOV_DEG, words, flags)
    ui.mark("paths.fov")
    _follow_gesture(ui)
    if is_edited:
        dispatch(SetCameraKeyFov(index, math.radians(fov_deg), ui.paths.gesture))
    imgui.set_item_tooltip("Vertical field of view")
    if _flowing_button("Take view", is_first=True):
        dispatch(AimCameraKey(index))
    ui.mark("paths.aim")
    imgui.set_item_tooltip("Sets the key's position, direction and lens from this view (Shift+C)")
    if _flowing_button("Delete"):
        dispatch(DeleteCameraKey(index))
    ui.mark("paths.remove")
    imgui.set_item_tooltip("Delete")
    imgui.end_disabled()
    if _flowing_button("Go"):
        choose_key(dispatch, ui, index, is_going=True)
    ui.mark("paths.go")
    imgui.set_item_tooltip("Look from this key, at its frame")


def _follow_gesture(ui: UiState) -> None:
    """Make the whole drag after one press a single step to undo."""
    if imgui.is_item_activated():
        ui.paths.begin_gesture()
