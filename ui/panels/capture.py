"""The capture panel: the open capture, and its cameras as a list; a click looks through one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from imgui_bundle import ImVec2, imgui

from app.session.session_view import CaptureFacts, SessionView
from app.session.showing.look_commands import LookThrough
from engine.camera.rig import CameraRig
from engine.text import one_line
from ui.gl.image import ImageTexture
from ui.panels.editing.labels import draw_label_field, with_label
from ui.panels.excluding.menu import draw_exclusion_menu
from ui.panels.pieces.widgets import elided, pop_bold, push_bold, text_wrapped_dim
from ui.panels.state import Dispatch, Rect, UiState
from ui.panels.timeline.rows.stage import hatch
from ui.panels.welcome.thumbnails import Thumbnails
from ui.style import theme
from ui.style.numbers import format_count
from ui.style.theme import Icon

ROW_HEIGHT = 50.0
PICTURE_SIZE = (64.0, 40.0)
HELD_OUT_WORDS, EXCLUDED_WORDS = ("held out", "test"), ("excluded", "out")
"""The longest that there is room for."""


class CapturePanel:
    """Draws the list; owns the thumbnail textures and nothing else.

    Args:
        make_texture: Makes an empty texture with `set(image)`, `texture` and `release()` (ui.gl.ImageTexture).
    """

    def __init__(self, make_texture: Callable[[], ImageTexture]) -> None:
        self._thumbnails = Thumbnails(make_texture)
        self._capture_path: Path | None = None
        self._filter = ""
        self._shown_camera: int | None = None

    @property
    def is_waiting(self) -> bool:
        """Is a thumbnail of a visible row still to come?"""
        return self._thumbnails.is_waiting

    def release(self) -> None:
        """Free the thumbnails. GL thread only."""
        self._thumbnails.release()

    def draw(self, session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        """Summary, then one row per camera."""
        capture = session.capture
        if capture is None:
            text_wrapped_dim("Cameras appear here once a capture is open.")
            return
        if capture.path != self._capture_path:
            self.release()
            self._capture_path = capture.path
        self._draw_summary(capture, session, ui)
        is_free = session.view.look_through is None
        if imgui.selectable(f"{Icon.EYE}  Free view", is_free, 0, ImVec2(0, 24))[0] and not is_free:
            dispatch(LookThrough(None))
        ui.mark("capture.free")
        imgui.separator()
        if imgui.begin_child("cameras", child_flags=imgui.ChildFlags_.nav_flattened):
            self._draw_cameras(capture.rig, session, dispatch, ui)
        imgui.end_child()

    def _draw_summary(self, capture: CaptureFacts, session: SessionView, ui: UiState) -> None:
        push_bold(ui, ui.fonts.body_size + 1)
        imgui.text(elided(capture.path.name, imgui.get_content_region_avail().x))
        pop_bold(ui)
        imgui.set_item_tooltip(str(capture.path))
        seconds = capture.n_frames / max(capture.fps, 1e-6)
        n_cameras, n_frames = format_count(len(capture.rig)), format_count(capture.n_frames)
        text_wrapped_dim(f"{n_cameras} cameras, {n_frames} frames, {seconds:.1f} s")
        held_out = frozenset(session.holdout)
        measured = f" - {len(held_out)} held out for measuring" if held_out else ""
        text_wrapped_dim(f"{format_count(len(session.clips))} clips{measured}")
        recording = session.recording_status
        if recording.is_followed:
            text_wrapped_dim(f"Recording: {recording.words or 'looking for frames'}")
        imgui.spacing()

    def _draw_cameras(self, rig: CameraRig, session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        held_out = frozenset(session.holdout)
        shown = session.view.look_through
        self._thumbnails.begin()
        for index, name in enumerate(rig.names):
            imgui.push_id(index)
            top_left = imgui.get_cursor_screen_pos()
            is_clicked, _ = imgui.selectable("##camera", shown == index, 0, ImVec2(0, ROW_HEIGHT))
            is_visible = imgui.is_item_visible()
            low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
            if is_visible:
                ui.mark(f"capture.camera{index}")
            if imgui.begin_popup_context_item("camera menu"):
                imgui.text_disabled(one_line(name))
                draw_label_field(session, dispatch, ui, "camera", name)
                imgui.separator()
                draw_exclusion_menu(session, dispatch, ui, index, session.timeline.frame_index)
                imgui.end_popup()
            if is_clicked:
                dispatch(LookThrough(None if shown == index else index))
            if shown == index and shown != self._shown_camera:
                imgui.set_scroll_here_y(0.5)
                self._shown_camera = shown
            if is_visible:
                row = Rect(top_left.x, low.y, high.x, high.y)
                if self._draw_row(session, ui, row, index, index in held_out, is_shown=shown == index):
                    imgui.set_item_tooltip(with_label(session, "camera", name, name))
            imgui.pop_id()
        if shown is None:
            self._shown_camera = None

    def _draw_row(
        self, session: SessionView, ui: UiState, row: Rect, index: int, is_held_out: bool, *, is_shown: bool
    ) -> bool:
        """Picture, name and size of a camera. Whether its name had to be cut."""
        assert session.capture is not None
        rig = session.capture.rig
        draw = imgui.get_window_draw_list()
        if is_shown:
            draw.add_rect_filled(row.low, ImVec2(row.x0 + 3, row.y1), theme.u32(theme.SKY))
        box = Rect(row.x0 + 4, row.y0 + 5, row.x0 + 4 + PICTURE_SIZE[0], row.y0 + 5 + PICTURE_SIZE[1])
        self._thumbnails.draw(session, index, 0, box, ui)
        x, room = box.x1 + 10, row.x1 - box.x1 - 14
        if is_shown:
            push_bold(ui, ui.fonts.body_size)
        title = with_label(session, "camera", rig.names[index], rig.names[index])
        name = elided(title, room)
        draw.add_text(ImVec2(x, row.y0 + 6), theme.u32(theme.TEXT), name)
        if is_shown:
            pop_bold(ui)
        width, height = (int(v) for v in rig.image_sizes[index])
        size = f"{width} x {height}"
        size_width = imgui.calc_text_size(size).x
        is_excluded = rig.names[index] in session.exclusions.cameras
        if is_excluded:
            hatch(draw, box, theme.ON_PICTURE.yellow, 9.0)
        is_marked, words = is_held_out or is_excluded, EXCLUDED_WORDS if is_excluded else HELD_OUT_WORDS
        label = next((word for word in words if imgui.calc_text_size(word).x + 14 <= room), "")
        is_size_shown = not (is_marked and size_width + imgui.calc_text_size(label).x + 22 > room)
        if is_size_shown:
            draw.add_text(ImVec2(x, row.y0 + 26), theme.u32(theme.TEXT_DIM), size)
        if is_marked and label:
            left = row.x1 - 18 - imgui.calc_text_size(label).x if is_size_shown else x
            tag = Rect(left, row.y0 + 25, left + imgui.calc_text_size(label).x + 14, row.y0 + 44)
            color = theme.u32(theme.YELLOW if is_excluded else theme.HELD_OUT)
            draw.add_rect(tag.low, tag.high, color, 4)
            draw.add_text(ImVec2(tag.x0 + 7, tag.y0 + 1), color, label)
        return name != title
