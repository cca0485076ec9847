"""The box in the toolbar that says what colours mean, and which part of a clip is drawn."""

from __future__ import annotations

from imgui_bundle import ImVec4, imgui

from app.playback.modes.view_modes import ALL, COLOR, CONTENTS, MODES
from app.session.commands import SetContent, SetMode
from app.session.session_view import SessionView
from ui.panels.actions.viewing.modes import mode_key
from ui.panels.pieces.widgets import box_flags, box_words
from ui.panels.state import Dispatch, UiState
from ui.style import theme


def mode_words(session: SessionView) -> str:
    """What the box says: the mode, or the part of a clip and then the mode."""
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
    if not is_plain:  # what is seen is not the scene: that should be noticed
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
