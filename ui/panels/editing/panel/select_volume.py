"""A volume by numbers: the one that was drawn last, or one around what the view turns about."""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, imgui
from msgspec import structs

from app.playback.views.orbit_view import OrbitView
from app.session.editing.selection_commands import SelectVolume
from app.session.session_view import SessionView
from engine.editing.actions import Vector
from engine.editing.edit import Box, Prism, Sphere, Volume
from ui.panels.editing.edit_subject import drawn_volume
from ui.panels.editing.panel.sections import section_header
from ui.panels.pieces.widgets import primary_button
from ui.panels.state import Dispatch, UiState
from ui.viewport.editing.select_tool import standing_quat

FIRST_SHARE = 0.15
"""Size of a volume that nobody has drawn, as a share of how far away the view's pivot is."""
LARGEST = 1e6


def draw_volume_numbers(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Numbers of the volume, and the commands that use them."""
    if not section_header(ui, "volume", is_used=drawn_volume(ui) is not None):
        return
    imgui.begin_disabled(not session.selection.can_select)
    _draw_numbers(session, dispatch, ui)
    imgui.end_disabled()


def _draw_numbers(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    tool, width = ui.selecting, (imgui.get_content_region_avail().x - 4) / 2
    for name in ("box", "sphere"):
        if name == "sphere":
            imgui.same_line(0, 4)
        if imgui.button(f"New {name}", ImVec2(width, 0)):
            tool.volume, tool.kind = _first(session.view, name), name
            tool.points = []
        ui.mark(f"selection.new_{name}")
    volume = tool.volume
    if volume is None:
        return
    center = _input_vector("Middle", volume.center, ui)
    if isinstance(volume, Box | Prism):
        x, y, z = _input_vector("Half sizes", volume.half_sizes, ui)
        half_sizes = (max(x, 1e-9), max(y, 1e-9), max(z, 1e-9))
        changed: Volume = structs.replace(volume, center=center, half_sizes=half_sizes)
    else:
        imgui.set_next_item_width(_room())
        _, radius = imgui.input_float("Radius", volume.radius, 0.0, 0.0, "%.4g")
        ui.mark("selection.radius")
        changed = Sphere(center, min(max(radius, 1e-9), LARGEST) if np.isfinite(radius) else volume.radius)
    tool.volume = changed
    if primary_button("Select inside", ImVec2(imgui.get_content_region_avail().x, 30), ui):
        dispatch(SelectVolume(changed, tool.how(), tool.is_by_extent))
    ui.mark("selection.by_volume")


def _first(view: OrbitView, name: str) -> Box | Sphere:
    pose = view.shown_pose
    size = max(FIRST_SHARE * float(np.linalg.norm(pose.pivot - pose.standpoint)), 1e-6)
    x, y, z = (float(value) for value in pose.pivot)
    if name == "sphere":
        return Sphere((x, y, z), size)
    return Box((x, y, z), (size, size, size), standing_quat(view.world_to_camera(), np.asarray(view.up, np.float64)))


def _input_vector(label: str, vector: Vector, ui: UiState) -> Vector:
    imgui.set_next_item_width(_room())
    is_changed, typed = imgui.input_float3(label, list(vector), "%.4g")
    ui.mark(f"selection.{label.lower().replace(' ', '_')}")
    if not is_changed or not np.isfinite(typed).all():
        return vector
    x, y, z = (float(np.clip(value, -LARGEST, LARGEST)) for value in typed)
    return x, y, z


def _room() -> float:
    return -imgui.calc_text_size("Half sizes    ").x
