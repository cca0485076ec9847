"""Entries of a context menu that leave a camera or a picture out of training, or let it take part again."""

from __future__ import annotations

from imgui_bundle import imgui

from app.session.exclusions.exclusion_commands import ExcludeCameras, ExcludeFrames, RemoveMasks
from app.session.session_view import SessionView
from app.session.showing.look_commands import LookThrough
from ui.panels.state import Dispatch, UiState
from ui.viewport.excluding.mask_tool import SCOPES


def draw_exclusion_menu(
    session: SessionView, dispatch: Dispatch, ui: UiState, camera_index: int, frame_index: int
) -> None:
    """A camera, a frame, a frame of a camera; a painted part of its pictures."""
    name, found = session.rig.names[camera_index], session.exclusions
    imgui.text_disabled("Exclude from training")
    is_out = name in found.cameras
    if _item(ui, "camera", f"Camera {_plain(name)}", is_on=is_out):
        dispatch(ExcludeCameras((camera_index,), not is_out))
    for entry, camera, words in (
        ("picture", camera_index, f"Frame {frame_index} of this camera"),
        ("frame", None, f"Frame {frame_index} of all cameras"),
    ):
        of = None if camera is None else name
        is_out = any(one.camera == of and one.first <= frame_index < one.stop for one in found.frames)
        if _item(ui, entry, words, is_on=is_out):
            dispatch(ExcludeFrames(frame_index, frame_index + 1, camera, not is_out))
    imgui.separator()
    for scope, words in SCOPES.items():
        if _item(ui, f"paint.{scope}", f"Paint a mask, in {words}"):
            dispatch(LookThrough(camera_index))
            ui.masks.start(camera_index, scope)
    has_mask = any(one.camera == name for one in found.masks)
    if _item(ui, "unpaint", "Remove the mask", is_enabled=has_mask):
        dispatch(RemoveMasks(camera_index))


def _plain(name: str) -> str:
    """A name as it can stand in a label of ImGui."""
    return name.replace("#", "\u200b#")


def _item(ui: UiState, name: str, label: str, *, is_on: bool = False, is_enabled: bool = True) -> bool:
    is_chosen = imgui.menu_item(f"{label}###exclude {name}", "", is_on, is_enabled)[0]
    ui.mark(f"exclude menu.{name}")
    return is_chosen
