"""The row over the picture: which camera, what it is compared with, what is shown over it, and marking."""

from __future__ import annotations

from typing import Protocol

from imgui_bundle import ImVec2, imgui

from app.playback.views import COUNTS
from app.session.commands import LookThrough, ShowViews, ToggleOverlay
from ui.panels.actions.compare import cloud_overlay
from ui.panels.actions.view import next_layout
from ui.panels.compare_box import CompareNeeds, draw_compare_box
from ui.panels.heat_box import draw_heat_box
from ui.panels.mode_box import draw_mode_box
from ui.panels.navigation import ViewPopup
from ui.panels.regions import begin_choosing
from ui.panels.state import Dispatch, UiState
from ui.panels.widgets import box_flags, segment
from ui.style.theme import Icon

TOOLBAR_HEIGHT = 38.0
WORDY_WIDTH, LAYOUTS_WIDTH = 820.0, 520.0
"""With less room than the first, words give way to symbols; with less than the second, so do the numbers of views."""
WORDY, SYMBOLS = 264.0, 150.0
"""What the buttons between the boxes and the numbers of views take, with words and without, units."""
N_BOXES = 4
LEAST_BOX, MOST_BOX = 46.0, 150.0
GAP = 8.0
MARK_SLIDER = imgui.SliderFlags_.always_clamp


class ToolbarNeeds(CompareNeeds, Protocol):
    """What the row reads."""


def draw_toolbar(session: ToolbarNeeds, dispatch: Dispatch, ui: UiState, popup: ViewPopup) -> None:
    """The row of choices over the picture."""
    imgui.set_cursor_pos(ImVec2(imgui.get_cursor_pos_x() + 8, imgui.get_cursor_pos_y() + 6))
    shown = session.view.look_through
    names = session.rig.names
    room = imgui.get_content_region_avail().x
    is_wordy = room > WORDY_WIDTH
    n_layouts = len(COUNTS) if room > LAYOUTS_WIDTH else 1
    fixed = (WORDY if is_wordy else SYMBOLS) + n_layouts * (imgui.get_frame_height() + 2)
    width = min(max((room - fixed) / N_BOXES - GAP, LEAST_BOX), MOST_BOX)
    imgui.align_text_to_frame_padding()
    imgui.set_next_item_width(width)
    if imgui.begin_combo("##camera", "Free" if shown is None else names[shown], box_flags(width)):
        if imgui.selectable("Free", shown is None)[0]:
            dispatch(LookThrough(None))
        for index, name in enumerate(names):
            imgui.push_id(index)  # names may be equal before a "##", which is all that ImGui would tell apart
            is_chosen = imgui.selectable("##camera", shown == index)[0]
            ui.mark(f"viewport.camera{index}")
            imgui.same_line(0, 0)
            imgui.text(name)
            imgui.pop_id()
            if is_chosen:
                dispatch(LookThrough(index))
        imgui.end_combo()
    ui.mark("viewport.camera")
    imgui.set_item_tooltip("Look through a capture camera ([ and ])")
    imgui.same_line(0, GAP)
    draw_mode_box(session, dispatch, ui, width)
    imgui.same_line(0, GAP)
    draw_compare_box(session, dispatch, ui, width)
    imgui.same_line(0, GAP)
    draw_heat_box(session, dispatch, ui, width)
    imgui.same_line(0, GAP)
    if imgui.button(f"{Icon.EYE}  Show" if is_wordy else f"{Icon.EYE}##show"):
        imgui.open_popup("overlays")
    ui.mark("viewport.overlays")
    _draw_overlay_menu(session, dispatch, ui)
    imgui.same_line(0, GAP)
    popup.draw_button(session, dispatch, ui)
    imgui.same_line(0, GAP)
    imgui.begin_disabled(not session.regions.can_mark)
    if segment(f"{Icon.REGION}  Mark" if is_wordy else Icon.REGION, ui.regions.is_active):
        if ui.regions.is_active:
            ui.regions.leave()
        else:
            begin_choosing(session, ui)
    ui.mark("viewport.mark")
    imgui.end_disabled()
    words = session.regions.why_not or "Say of a part of the scene that it is static, or that it moves (M)"
    if imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_disabled):
        imgui.set_tooltip(words)
    _draw_layouts(session, dispatch, ui, n_layouts)


def _draw_layouts(session: ToolbarNeeds, dispatch: Dispatch, ui: UiState, n_buttons: int) -> None:
    """How many views, at the right end; one button that goes on to the next number where there is little room."""
    width, shown = imgui.get_frame_height(), session.views.n_shown
    imgui.same_line(0, GAP)
    free = imgui.get_content_region_avail().x - n_buttons * (width + 2) - GAP
    imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(free, 0.0))
    if n_buttons == 1:
        if imgui.button(f"{shown}##views", ImVec2(width, 0)):
            next_layout(session, dispatch, ui)
        ui.mark("viewport.views")
        imgui.set_item_tooltip("One, two or four views (V)")
        return
    for n in COUNTS:
        if segment(f"{n}##views", shown == n, width):
            dispatch(ShowViews(n))
        ui.mark(f"viewport.views{n}")
        imgui.set_item_tooltip(f"{n} view{'s' if n > 1 else ''} (V)")
        imgui.same_line(0, 2)
    imgui.new_line()


def _draw_overlay_menu(session: ToolbarNeeds, dispatch: Dispatch, ui: UiState) -> None:
    if not imgui.begin_popup("overlays"):
        return
    rows = (
        ("show_frusta", "Cameras", "1"),
        ("show_inherited", "Inherited anchors (circles)", "2"),
        ("show_residual", "Residual anchors (diamonds)", "3"),
        (cloud_overlay(session), "Point cloud", "4"),
        ("show_regions", "Marked regions", "5"),
        ("show_coverage", "Covered by inherited anchors", "9"),
        ("show_trails", "Trails of what moves", "0"),
        ("show_paths", "Camera path", "Shift+P"),
    )
    for name, label, key_label in rows:
        if imgui.menu_item(label, key_label, bool(getattr(session.overlays, name)), True)[0]:
            dispatch(ToggleOverlay(name))
        ui.mark(f"show.{name}")
    imgui.separator()
    overlays = session.overlays
    imgui.text_disabled("Anchor marks")
    imgui.set_next_item_width(150)
    size = imgui.slider_float("Size", overlays.mark_size * 100.0, 50.0, 300.0, "%.0f %%", MARK_SLIDER)
    overlays.mark_size = size[1] / 100.0
    ui.mark("show.mark_size")
    imgui.set_next_item_width(150)
    opacity = imgui.slider_float("Opacity", overlays.mark_opacity * 100.0, 10.0, 100.0, "%.0f %%", MARK_SLIDER)
    overlays.mark_opacity = opacity[1] / 100.0
    ui.mark("show.mark_opacity")
    imgui.separator()
    imgui.text_disabled("Tab hides or shows cameras and anchors")
    imgui.end_popup()
