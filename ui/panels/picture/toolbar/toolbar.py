"""The row over the picture: which camera, the comparison, the overlays, and marking."""

from __future__ import annotations

from imgui_bundle import ImVec2, ImVec4, imgui

from app.playback.modes.view_modes import ALL, COLOR, CONTENTS, MODES
from app.playback.views.views import COUNTS
from app.residuals.heat_map import HEAT_KINDS
from app.session.session_view import SessionView
from app.session.showing.look_commands import LookThrough, SetContent, SetMode, ShowHeat, ShowViews, ToggleOverlay
from ui.panels.actions.viewing.compare import cloud_overlay
from ui.panels.actions.viewing.modes import mode_key
from ui.panels.editing.panel.marks import begin_choosing
from ui.panels.picture.toolbar.compare_box import compare_words, draw_compare_box
from ui.panels.picture.toolbar.navigation import ViewPopup
from ui.panels.picture.toolbar.row_fit import fit_row
from ui.panels.pieces.slider import slider
from ui.panels.pieces.widgets import MOST_BOX, box_flags, box_width, box_words, segment
from ui.panels.state import Dispatch, UiState
from ui.style import theme
from ui.style.theme import Icon

TOOLBAR_HEIGHT = 38.0
GAP = 8.0
MARK_SLIDER = imgui.SliderFlags_.always_clamp


STYLES = ((True, True), (False, True), (False, False))
"""Whether buttons have words, and whether boxes have arrows however short their word is; the roomiest first."""
HIDDEN_FIRST = ("views", "heat", "compare", "mark")
"""Parts that go into the menu at the end of the row where there is no room for them."""
HIDDEN_WORDS = {"compare": "Compare", "heat": "Heat map", "views": "Views"}
HIDDEN_X = 90.0
BOX = 150.0
"""Boxes become so wide where there is room."""


def draw_toolbar(session: SessionView, dispatch: Dispatch, ui: UiState, popup: ViewPopup) -> None:
    """The row of choices over the picture; those without room are in a menu at its end."""
    imgui.set_cursor_pos(ImVec2(imgui.get_cursor_pos_x() + GAP, imgui.get_cursor_pos_y() + 6))
    room = imgui.get_content_region_avail().x - GAP
    words = {
        "camera": _camera_words(session),
        "mode": mode_words(session),
        "compare": compare_words(session),
        "heat": heat_words(session),
    }
    styles = [_widths(words, *style) for style in STYLES]
    fit = fit_row(styles, room, gap=GAP, menu=_button_width(Icon.MORE), can_hide=HIDDEN_FIRST)
    is_wordy, has_arrows = STYLES[fit.style]
    free = room - sum(fit.widths.values()) - GAP * (len(fit.widths) - 1) - 1
    free -= GAP + _button_width(Icon.MORE) if fit.hidden else 0.0
    boxes = [name for name in words if name in fit.widths]

    def box(name: str) -> float:
        """Width of a box: its least width, and its part of the rest; less than it needs in a very narrow row."""
        more = free / len(boxes) if has_arrows or free < 0.0 else 0.0  # a wider one would get an arrow
        return min(fit.widths[name] + more, max(fit.widths[name], BOX))

    for name in fit.widths:
        match name:
            case "camera":
                _draw_camera_box(session, dispatch, ui, box(name))
            case "mode":
                draw_mode_box(session, dispatch, ui, box(name))
            case "compare":
                draw_compare_box(session, dispatch, ui, box(name))
            case "heat":
                draw_heat_box(session, dispatch, ui, box(name))
            case "show":
                _draw_show(session, dispatch, ui, is_wordy=is_wordy)
            case "look":
                popup.draw_button(session, dispatch, ui)
            case "mark":
                _draw_mark(session, ui, is_wordy=is_wordy)
            case _:
                free = imgui.get_content_region_avail().x - fit.widths[name] - GAP
                imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(free, 0.0))
                _draw_layouts(session, dispatch, ui)
        imgui.same_line(0, GAP)
    if fit.hidden:
        _draw_more(session, dispatch, ui, fit.hidden)
    imgui.new_line()


def _widths(words: dict[str, str], is_wordy: bool, has_arrows: bool) -> dict[str, float]:
    """Width of each part of the row in a style, in its order."""
    widths = {name: box_width(text, has_arrow=has_arrows) for name, text in words.items()}
    widths["show"] = _button_width(f"{Icon.EYE}  Show" if is_wordy else Icon.EYE)
    widths["look"] = _button_width(Icon.COMPASS)
    widths["mark"] = _button_width(f"{Icon.REGION}  Mark" if is_wordy else Icon.REGION)
    widths["views"] = len(COUNTS) * (imgui.get_frame_height() + 2)
    return widths


def _button_width(label: str) -> float:
    return imgui.calc_text_size(label).x + 2 * imgui.get_style().frame_padding.x


def _draw_more(session: SessionView, dispatch: Dispatch, ui: UiState, hidden: tuple[str, ...]) -> None:
    """The button at the end of the row, and its menu."""
    if imgui.button(f"{Icon.MORE}##more"):
        imgui.open_popup("more")
    ui.mark("viewport.more")
    imgui.set_item_tooltip("More tools")
    _put_popup_below()
    if not imgui.begin_popup("more"):
        return
    for name in hidden:
        if name == "mark":
            _draw_mark(session, ui, is_wordy=True)
            continue
        imgui.align_text_to_frame_padding()
        imgui.text_disabled(HIDDEN_WORDS[name])
        imgui.same_line(HIDDEN_X)
        if name == "compare":
            draw_compare_box(session, dispatch, ui, MOST_BOX)
        elif name == "heat":
            draw_heat_box(session, dispatch, ui, MOST_BOX)
        else:
            _draw_layouts(session, dispatch, ui)
            imgui.new_line()
    imgui.end_popup()


def _put_popup_below() -> None:
    """The popup that may open next covers neither the newest item nor the pointer."""
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    imgui.set_next_window_pos(ImVec2(low.x, high.y + 6), imgui.Cond_.appearing)


def _camera_words(session: SessionView) -> str:
    shown = session.view.look_through
    return "Free" if shown is None else session.rig.names[shown]


def _draw_camera_box(session: SessionView, dispatch: Dispatch, ui: UiState, width: float) -> None:
    shown, names = session.view.look_through, session.rig.names
    imgui.align_text_to_frame_padding()
    imgui.set_next_item_width(width)
    if imgui.begin_combo("##camera", box_words(_camera_words(session), width), box_flags(width)):
        if imgui.selectable("Free", shown is None)[0]:
            dispatch(LookThrough(None))
        for index, name in enumerate(names):
            imgui.push_id(index)  # names may be equal before a "##", which is all that ImGui would distinguish
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


def _draw_show(session: SessionView, dispatch: Dispatch, ui: UiState, *, is_wordy: bool) -> None:
    if imgui.button(f"{Icon.EYE}  Show" if is_wordy else f"{Icon.EYE}##show"):
        imgui.open_popup("overlays")
    ui.mark("viewport.overlays")
    _put_popup_below()
    _draw_overlay_menu(session, dispatch, ui)


def _draw_mark(session: SessionView, ui: UiState, *, is_wordy: bool) -> None:
    imgui.begin_disabled(not session.regions.can_mark)
    if segment(f"{Icon.REGION}  Mark" if is_wordy else Icon.REGION, ui.regions.is_active):
        if ui.regions.is_active:
            ui.regions.leave()
        else:
            begin_choosing(session, ui)
    ui.mark("viewport.mark")
    imgui.end_disabled()
    words = session.regions.why_not or "Mark part of the scene as static or moving (M)"
    if imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_disabled):
        imgui.set_tooltip(words)


def _draw_layouts(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """How many views."""
    width, shown = imgui.get_frame_height(), session.views.n_shown
    for n in COUNTS:
        if segment(f"{n}##views", shown == n, width):
            dispatch(ShowViews(n))
        ui.mark(f"viewport.views{n}")
        imgui.set_item_tooltip(f"{n} view{'s' if n > 1 else ''} (V)")
        imgui.same_line(0, 2)


def _draw_overlay_menu(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    if not imgui.begin_popup("overlays"):
        return
    rows = (
        ("show_frusta", "Cameras", "1"),
        ("show_inherited", "Inherited anchors (circles)", "2"),
        ("show_residual", "Residual anchors (diamonds)", "3"),
        (cloud_overlay(session), "Point cloud", "4"),
        ("show_regions", "Marked regions", "5"),
        ("show_coverage", "Space of inherited anchors", "9"),
        ("show_trails", "Motion trails", "0"),
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
    size = slider("Size", overlays.mark_size * 100.0, 50.0, 300.0, "%.0f %%", MARK_SLIDER)
    overlays.mark_size = size[1] / 100.0
    ui.mark("show.mark_size")
    imgui.set_next_item_width(150)
    opacity = slider("Opacity", overlays.mark_opacity * 100.0, 10.0, 100.0, "%.0f %%", MARK_SLIDER)
    overlays.mark_opacity = opacity[1] / 100.0
    ui.mark("show.mark_opacity")
    imgui.separator()
    imgui.text_disabled("Tab hides or shows cameras and anchors")
    imgui.end_popup()


_CLAMPED = imgui.SliderFlags_.always_clamp


def heat_words(session: SessionView) -> str:
    """Label of the box."""
    return HEAT_KINDS[session.overlays.heat].label if session.overlays.heat else "Heat"


def draw_heat_box(session: SessionView, dispatch: Dispatch, ui: UiState, width: float) -> None:
    """Which residual is shown over the picture, and how strongly. width: Units."""
    overlays = session.overlays
    imgui.set_next_item_width(width)
    if imgui.begin_combo("##heat", box_words(heat_words(session), width), box_flags(width)):
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
        percent = slider("Opacity", overlays.heat_opacity * 100.0, 10.0, 100.0, "%.0f %%", _CLAMPED)[1]
        overlays.heat_opacity = percent / 100.0
        ui.mark("viewport.heat.opacity")
        imgui.end_combo()
    ui.mark("viewport.heat")
    imgui.set_item_tooltip("Where the render differs from the previous frame or from the captured picture (7)")


def mode_words(session: SessionView) -> str:
    """Label of the box: the mode, or the part of a clip and then the mode."""
    overlays = session.overlays
    words = MODES[overlays.mode].label
    if overlays.content == ALL:
        return words
    return CONTENTS[overlays.content].label + ("" if overlays.mode == COLOR else f", {words.lower()}")


def draw_mode_box(session: SessionView, dispatch: Dispatch, ui: UiState, width: float) -> None:
    """A box of modes, and below them of parts of a clip. width: Units."""
    overlays = session.overlays
    imgui.set_next_item_width(width)
    is_plain = overlays.mode == COLOR and overlays.content == ALL
    if not is_plain:  # not the plain scene: that should be noticed
        imgui.push_style_color(imgui.Col_.text, ImVec4(*theme.YELLOW))
    is_open = imgui.begin_combo("##mode", box_words(mode_words(session), width), box_flags(width))
    if not is_plain:
        imgui.pop_style_color()
    ui.mark("viewport.mode")
    if not is_open:
        imgui.set_item_tooltip("View mode (Shift and a number), and which part of a clip is drawn")
        return
    imgui.text_disabled("View mode")
    for mode in MODES.values():
        if imgui.menu_item(mode.label, mode_key(mode.name), overlays.mode == mode.name, True)[0]:
            dispatch(SetMode(mode.name))
        ui.mark(f"viewport.mode.{mode.name}")
        imgui.set_item_tooltip(mode.explanation)
    imgui.separator()
    imgui.text_disabled("Drawn")
    for content in CONTENTS.values():
        if imgui.menu_item(content.label, "", overlays.content == content.name, True)[0]:
            dispatch(SetContent(content.name))
        ui.mark(f"viewport.content.{content.name}")
        imgui.set_item_tooltip(content.explanation)
    imgui.end_combo()
