"""The popup of the toolbar on how one looks: lens, axes, the upward direction, and the bookmarks of the project."""

from __future__ import annotations

import math

from imgui_bundle import ImVec2, imgui

from app.playback.views.bookmarks import MAX_NAME_CHARACTERS
from app.playback.views.orbit_view import MAX_FOV_Y, MIN_FOV_Y
from app.playback.views.scene_axes import AXIS_VIEWS, UP_AXES
from app.playback.views.view_place import ViewPlace
from app.session.session_view import SessionView
from app.session.showing.look_commands import LookThrough
from ui.panels.actions.viewing.bookmarks import go_to_bookmark
from ui.panels.actions.viewing.navigation import frame_all, frame_selection, toggle_orthographic, up_words
from ui.panels.picture.gestures import PRESETS
from ui.panels.pieces.widgets import elided, text_right
from ui.panels.state import Dispatch, UiState
from ui.style import theme
from ui.style.theme import Icon

POPUP = "looking"
WIDTH = 300.0
HIGHEST_LIST = 190.0


class ViewPopup:
    """Owns the name that is being typed."""

    def __init__(self) -> None:
        self._name = ""
        self._has_frame = False

    def draw_button(self, session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        """The button of the toolbar, and its popup."""
        if imgui.button(f"{Icon.COMPASS}##look") or ui.is_view_popup_wanted:
            ui.is_view_popup_wanted = False
            imgui.open_popup(POPUP)
        ui.mark("viewport.look")
        imgui.set_item_tooltip("Lens, axes, up direction and bookmarks (Ctrl+B)")
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        imgui.set_next_window_pos(ImVec2(low.x, high.y + 6), imgui.Cond_.appearing)  # not where the pointer is
        imgui.set_next_window_size(ImVec2(WIDTH, 0))
        if imgui.begin_popup(POPUP):
            self._draw_lens(session, dispatch, ui)
            _draw_axes(session, dispatch, ui)
            self._draw_bookmarks(session, dispatch, ui)
            imgui.end_popup()

    def _draw_lens(self, session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        view = session.view
        imgui.text_disabled("Field of view")
        text_right("of the camera" if view.look_through is not None else f"{math.degrees(view.fov_y):.0f} degrees")
        imgui.set_next_item_width(-1)
        limits = (math.degrees(MIN_FOV_Y), math.degrees(MAX_FOV_Y))
        flags = imgui.SliderFlags_.always_clamp | imgui.SliderFlags_.no_input
        is_moved, fov = imgui.slider_float("##fov", math.degrees(view.fov_y), *limits, "", flags)
        ui.mark("look.fov")
        if is_moved:
            if view.look_through is not None:
                dispatch(LookThrough(None))
            view.set_fov(math.radians(fov))
        if imgui.checkbox("Orthographic", view.is_orthographic)[0]:
            toggle_orthographic(session, dispatch, ui)
        ui.mark("look.orthographic")
        imgui.set_item_tooltip("Without perspective (numpad 5 or Alt+5)")
        imgui.same_line()
        imgui.begin_disabled(view.roll == 0.0)
        if imgui.button("Upright"):
            view.stand_upright()
        ui.mark("look.upright")
        imgui.end_disabled()
        imgui.set_item_tooltip("Resets the roll (Shift+\\)")
        imgui.separator()

    def _draw_bookmarks(self, session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        bookmarks = session.bookmarks
        imgui.text_disabled("Bookmarks")
        text_right("Ctrl+1 to Ctrl+9")
        room = imgui.get_content_region_avail().x
        imgui.set_next_item_width(room - imgui.get_frame_height() - 8)
        flags = imgui.InputTextFlags_.enter_returns_true
        is_entered, self._name = imgui.input_text_with_hint("##name", "Name of this view", self._name, flags)
        ui.mark("look.name")
        self._name = self._name[:MAX_NAME_CHARACTERS]
        imgui.same_line(0, 8)
        is_clicked = imgui.button(Icon.ADD, ImVec2(imgui.get_frame_height(), 0))
        ui.mark("look.keep")
        imgui.set_item_tooltip("Save this view")
        _, self._has_frame = imgui.checkbox("With its frame", self._has_frame)
        ui.mark("look.with_frame")
        if is_entered or is_clicked:
            frame_index = session.timeline.frame_index if self._has_frame else None
            bookmarks.add(self._name, ViewPlace.of(session.view), frame_index)
            self._name = ""
        if not bookmarks.items:
            return
        row = imgui.get_frame_height() + imgui.get_style().item_spacing.y
        if imgui.begin_child("bookmarks", ImVec2(0, min(len(bookmarks.items) * row + 4, HIGHEST_LIST))):
            _draw_list(session, dispatch, ui)
        imgui.end_child()


def _draw_axes(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    view = session.view
    third = (imgui.get_content_region_avail().x - 16) / 3
    for i, name in enumerate(AXIS_VIEWS):
        if i % 3:
            imgui.same_line(0, 8)
        if imgui.button(name.capitalize(), ImVec2(third, 0)):
            view.look_along(name)
        ui.mark(f"look.{name}")
    half = (imgui.get_content_region_avail().x - 8) / 2
    if imgui.button("Frame all", ImVec2(half, 0)):
        frame_all(session, dispatch, ui)
    ui.mark("look.frame_all")
    imgui.same_line(0, 8)
    if imgui.button("Frame selection", ImVec2(half, 0)):
        frame_selection(session, dispatch, ui)
    ui.mark("look.frame_selection")
    imgui.align_text_to_frame_padding()
    imgui.text_disabled("Up")
    imgui.same_line(110)
    imgui.set_next_item_width(-1)
    if imgui.begin_combo("##up", up_words(view.up_axis)):
        for name in UP_AXES:
            if imgui.selectable(up_words(name), view.up_axis == name)[0]:
                view.set_up_axis(name)
            ui.mark(f"look.up{name}")
        imgui.end_combo()
    ui.mark("look.up")
    imgui.align_text_to_frame_padding()
    imgui.text_disabled("Mouse")
    imgui.same_line(110)
    imgui.set_next_item_width(-1)
    navigation = ui.navigation
    if imgui.begin_combo("##preset", navigation.preset.label):
        for name, preset in PRESETS.items():
            if imgui.selectable(preset.label, navigation.preset is preset)[0]:
                navigation.preset_name = name
            ui.mark(f"look.preset.{name}")
        imgui.end_combo()
    ui.mark("look.preset")
    is_changed, is_eased = imgui.checkbox("Smooth view moves", not navigation.is_motion_reduced)
    ui.mark("look.eased")
    if is_changed:
        navigation.is_motion_reduced = not is_eased
    imgui.separator()


def _draw_list(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    removed = None
    for index, item in enumerate(session.bookmarks.items):
        imgui.push_id(index)
        room = imgui.get_content_region_avail().x - imgui.get_frame_height() - 8
        start = imgui.get_cursor_screen_pos()
        if imgui.button("##go", ImVec2(room, 0)):
            go_to_bookmark(session, dispatch, item)
            imgui.close_current_popup()
        ui.mark(f"look.bookmark{index}")
        details = "" if item.frame_index is None else f"frame {item.frame_index}"
        if item.number is not None:
            details = f"{details}   {item.number}".strip()
        width = imgui.calc_text_size(details).x
        draw, padding = imgui.get_window_draw_list(), imgui.get_style().frame_padding
        name = elided(" ".join(item.name.split()), room - width - 3 * padding.x)  # a name of several lines is one here
        draw.add_text(ImVec2(start.x + padding.x, start.y + padding.y), theme.u32(theme.TEXT), name)
        right = start.x + room - padding.x - width
        draw.add_text(ImVec2(right, start.y + padding.y), theme.u32(theme.TEXT_DIM), details)
        imgui.same_line(0, 8)
        if imgui.button(Icon.TRASH, ImVec2(imgui.get_frame_height(), 0)):
            removed = index
        ui.mark(f"look.remove{index}")
        imgui.pop_id()
    if removed is not None:
        session.bookmarks.remove(removed)
