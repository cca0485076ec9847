"""The row over the picture: which camera, what it is compared with, what is shown over it, and marking."""

from __future__ import annotations

from typing import Protocol

from imgui_bundle import ImVec2, ImVec4, imgui

from app.playback.views import COUNTS
from app.residuals.heat_map import HEAT_KINDS
from app.session.commands import LookThrough, ShowHeat, ShowViews, ToggleOverlay
from app.status import COMPARE_MODES
from ui.panels.actions.compare import COMPARE_WORDS, cloud_overlay, set_compare
from ui.panels.compare_box import CompareNeeds, draw_compare_box, draw_other_box
from ui.panels.comparison import shown_compare
from ui.panels.mode_box import draw_mode_box
from ui.panels.navigation import ViewPopup
from ui.panels.regions import begin_choosing
from ui.panels.state import Dispatch, UiState
from ui.style import theme
from ui.style.theme import Icon

TOOLBAR_HEIGHT = 38.0
TOOLBAR_WIDTH, TIGHT_WIDTH = 1180.0, 580.0
"""With less room than the first, words give way to symbols; with less than the second, boxes are narrow, too."""
MODE_WIDTHS, COMPARE_WIDTHS = (124.0, 108.0, 66.0), (130.0, 118.0, 66.0)
"""Of the boxes of modes and of comparisons, from much room to little, units."""
BESIDE_CAMERA = 268.0
"""What the row needs beside these boxes and that of the camera where there is little room, units."""
MARK_SLIDER = imgui.SliderFlags_.always_clamp


class ToolbarNeeds(CompareNeeds, Protocol):
    """What the row reads."""


def draw_toolbar(session: ToolbarNeeds, dispatch: Dispatch, ui: UiState, popup: ViewPopup) -> None:
    """The row of choices over the picture."""
    imgui.set_cursor_pos(ImVec2(imgui.get_cursor_pos_x() + 8, imgui.get_cursor_pos_y() + 6))
    shown = session.view.look_through
    names = session.rig.names
    room = imgui.get_content_region_avail().x
    is_roomy, row = room > TOOLBAR_WIDTH, (room <= TOOLBAR_WIDTH) + (room <= TIGHT_WIDTH)
    imgui.align_text_to_frame_padding()
    imgui.set_next_item_width(
        150 if is_roomy else min(120, max(room - BESIDE_CAMERA - MODE_WIDTHS[row] - COMPARE_WIDTHS[row], 40))
    )
    if imgui.begin_combo("##camera", "Free" if shown is None else names[shown]):
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
    imgui.same_line(0, 8)
    draw_mode_box(session, dispatch, ui, MODE_WIDTHS[row])
    imgui.same_line(0, 18 if is_roomy else 8)
    if is_roomy:
        imgui.text_disabled("Compare")
        for mode in COMPARE_MODES:
            imgui.same_line(0, 8 if mode == "off" else 2)
            if _segment(COMPARE_WORDS[mode], shown_compare(session) == mode):
                set_compare(session, dispatch, mode)
            ui.mark(f"viewport.compare.{mode}")
            imgui.set_item_tooltip("Beside, over or in turn with another picture (G)")
        imgui.same_line(0, 6)
        draw_other_box(session, dispatch, ui, COMPARE_WIDTHS[row])
    else:
        draw_compare_box(session, dispatch, ui, COMPARE_WIDTHS[row])
    imgui.same_line(0, 18 if is_roomy else 8)
    _draw_heat_box(session, dispatch, ui, is_roomy=is_roomy)
    imgui.same_line(0, 8)
    if imgui.button(f"{Icon.EYE}  Show" if is_roomy else f"{Icon.EYE}##show"):
        imgui.open_popup("overlays")
    ui.mark("viewport.overlays")
    _draw_overlay_menu(session, dispatch, ui)
    imgui.same_line(0, 8)
    popup.draw_button(session, dispatch, ui)
    imgui.same_line(0, 8)
    imgui.begin_disabled(not session.regions.can_mark)
    if _segment(f"{Icon.REGION}  Mark" if is_roomy else Icon.REGION, ui.regions.is_active):
        if ui.regions.is_active:
            ui.regions.leave()
        else:
            begin_choosing(session, ui)
    ui.mark("viewport.mark")
    imgui.end_disabled()
    words = session.regions.why_not or "Say of a part of the scene that it is static, or that it moves (M)"
    if imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_disabled):
        imgui.set_tooltip(words)
    _draw_layouts(session, dispatch, ui)


def _draw_layouts(session: ToolbarNeeds, dispatch: Dispatch, ui: UiState) -> None:
    """How many views, at the right end where there is room."""
    width = imgui.get_frame_height()
    imgui.same_line()
    left = imgui.get_cursor_pos_x() + imgui.get_content_region_avail().x - len(COUNTS) * (width + 2) - 8
    if left < imgui.get_cursor_pos_x():
        return
    imgui.set_cursor_pos_x(left)
    for n in COUNTS:
        if _segment(f"{n}##views", session.views.n_shown == n, width):
            dispatch(ShowViews(n))
        ui.mark(f"viewport.views{n}")
        imgui.set_item_tooltip(f"{n} view{'s' if n > 1 else ''} (V)")
        imgui.same_line(0, 2)
    imgui.new_line()


def _draw_heat_box(session: ToolbarNeeds, dispatch: Dispatch, ui: UiState, *, is_roomy: bool) -> None:
    """Which residual is shown over the picture, and how strongly."""
    overlays = session.overlays
    imgui.set_next_item_width(132 if is_roomy else 64)
    shown = HEAT_KINDS[overlays.heat].label if overlays.heat else "Heat map"
    if imgui.begin_combo("##heat", shown, imgui.ComboFlags_.height_large):
        if imgui.selectable("None", not overlays.heat)[0]:
            dispatch(ShowHeat(""))
        ui.mark("viewport.heat.none")
        for kind in HEAT_KINDS.values():
            if imgui.selectable(kind.label, overlays.heat == kind.name)[0]:
                dispatch(ShowHeat(kind.name))
            ui.mark(f"viewport.heat.{kind.name}")
            imgui.set_item_tooltip(kind.meaning)
        imgui.separator()
        imgui.set_next_item_width(150)
        percent = imgui.slider_float("Opacity", overlays.heat_opacity * 100.0, 10.0, 100.0, "%.0f %%", MARK_SLIDER)[1]
        overlays.heat_opacity = percent / 100.0
        ui.mark("viewport.heat.opacity")
        imgui.end_combo()
    ui.mark("viewport.heat")
    imgui.set_item_tooltip("Where the render differs, from the frame before or from what the camera took (7)")


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


def _segment(label: str, is_on: bool, width: float = 0.0) -> bool:
    if is_on:
        imgui.push_style_color(imgui.Col_.button, ImVec4(*theme.faded(theme.SKY, 0.9)))
        imgui.push_style_color(imgui.Col_.button_hovered, ImVec4(*theme.SKY))
        imgui.push_style_color(imgui.Col_.text, ImVec4(*theme.TEXT_ON_ACCENT))
    is_clicked = imgui.button(f"{label}##segment", ImVec2(width, 0))
    if is_on:
        imgui.pop_style_color(3)
    return is_clicked
