"""The box that takes a time and goes there."""

from __future__ import annotations

from imgui_bundle import ImVec2, ImVec4, imgui

from app.session.commands import SetFrame
from app.session.session_view import SessionView
from ui.panels.state import Dispatch, Rect, UiState
from ui.panels.timeline.jump_text import HINT, parse_jump
from ui.style import theme

POPUP = "go to"
WIDTH = 260.0


def draw_jump_box(session: SessionView, dispatch: Dispatch, ui: UiState, track: Rect) -> None:
    """Opens where it is wanted, just above the track. Enter goes there; the box stays where there is something to say
    of that, until Enter comes again or Escape."""
    view, timeline = ui.timeline, session.timeline
    is_new = view.is_jump_wanted
    if is_new:
        view.is_jump_wanted = False
        view.jump_text = view.jump_words = ""
        imgui.open_popup(POPUP)
    imgui.set_next_window_pos(ImVec2(track.x0 + 12, track.y0), imgui.Cond_.appearing, ImVec2(0, 1))
    if not imgui.begin_popup(POPUP):
        return
    imgui.text_unformatted("Go to")
    imgui.same_line()
    imgui.set_next_item_width(WIDTH)
    if imgui.is_window_appearing():
        imgui.set_keyboard_focus_here()
    flags = imgui.InputTextFlags_.enter_returns_true
    is_entered, view.jump_text = imgui.input_text_with_hint("##time", HINT, view.jump_text, flags)
    ui.mark("timeline.jump")
    if is_entered:
        jump = parse_jump(view.jump_text, timeline.frame_index, session.clips, timeline.fps)
        is_told = bool(jump.words) and jump.words == view.jump_words and jump.frame_index is not None
        view.jump_words = jump.words
        if jump.frame_index is not None:
            dispatch(SetFrame(jump.frame_index))
        if not jump.words or is_told:
            imgui.close_current_popup()
        else:
            imgui.set_keyboard_focus_here(-1)
    if view.jump_words:
        imgui.push_style_color(imgui.Col_.text, ImVec4(*theme.YELLOW))
        imgui.push_text_wrap_pos(imgui.get_cursor_pos_x() + WIDTH + 40)
        imgui.text_unformatted(view.jump_words)
        imgui.pop_text_wrap_pos()
        imgui.pop_style_color()
        ui.mark("timeline.jump words")
    if imgui.is_key_pressed(imgui.Key.escape, False):
        imgui.close_current_popup()
    imgui.end_popup()
