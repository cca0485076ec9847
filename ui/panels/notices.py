"""Notices of the session as toasts in the lower right corner of the viewport. Errors stay until they are dismissed."""

from __future__ import annotations

import time

from imgui_bundle import ImVec2, ImVec4, imgui

from app.session.commands import DismissNotice
from app.session.notices import Notice
from app.session.session_view import SessionView
from ui.panels.state import Dispatch, Rect, UiState
from ui.style import theme
from ui.style.theme import Icon

TOAST_WIDTH = 420.0
INFO_LIFETIME_S = 6.0
WARNING_LIFETIME_S = 20.0
MAX_TOASTS = 4
ROOM_BELOW = 34.0
"""The line that says what is shown stays readable."""

_ICONS = {"info": Icon.INFO, "warn": Icon.WARNING, "error": Icon.ERROR}


def notice_text(notice: Notice) -> str:
    """Everything a notice says, for the clipboard."""
    return "\n".join(part for part in (notice.title, notice.detail, notice.hint) if part)


class NoticesPanel:
    """Draws toasts; owns when each was first seen."""

    def __init__(self) -> None:
        self._seen_s: dict[int, float] = {}

    def draw(self, session: SessionView, dispatch: Dispatch, ui: UiState, area: Rect) -> None:
        """Newest at the bottom, at most MAX_TOASTS, stacked up from the lower right corner of the area."""
        notices = list(session.notices)
        now_s = time.monotonic()
        alive = {id(notice) for notice in notices}
        self._seen_s = {key: seen_s for key, seen_s in self._seen_s.items() if key in alive}
        right, y = area.x1 - 12, area.y1 - 12 - ROOM_BELOW
        for index in reversed(range(max(len(notices) - MAX_TOASTS, 0), len(notices))):
            notice = notices[index]
            age_s = now_s - self._seen_s.setdefault(id(notice), now_s)
            lifetime_s = {"info": INFO_LIFETIME_S, "warn": WARNING_LIFETIME_S}.get(notice.kind)
            if lifetime_s is not None and age_s > lifetime_s:
                dispatch(DismissNotice(index))
                continue
            if lifetime_s is not None:
                ui.redraw_within(max(lifetime_s - age_s, 0.05))
            y -= self._draw_toast(index, notice, dispatch, ui, ImVec2(right, y)) + 8

    def _draw_toast(self, index: int, notice: Notice, dispatch: Dispatch, ui: UiState, corner: ImVec2) -> float:
        icon = _ICONS.get(notice.kind, Icon.INFO)
        color = {"warn": theme.YELLOW, "error": theme.VERMILLION}.get(notice.kind, theme.SKY)
        imgui.set_next_window_pos(corner, imgui.Cond_.always, ImVec2(1.0, 1.0))
        imgui.set_next_window_size(ImVec2(TOAST_WIDTH, 0))
        flags = imgui.WindowFlags_.no_decoration | imgui.WindowFlags_.no_docking | imgui.WindowFlags_.no_move
        flags |= imgui.WindowFlags_.no_saved_settings | imgui.WindowFlags_.no_focus_on_appearing
        flags |= imgui.WindowFlags_.no_nav | imgui.WindowFlags_.always_auto_resize
        imgui.push_style_color(imgui.Col_.window_bg, ImVec4(*theme.RAISED))
        imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(18, 12))
        imgui.begin(f"##toast{id(notice)}", None, flags)
        imgui.pop_style_var()
        low, size = imgui.get_window_pos(), imgui.get_window_size()
        draw = imgui.get_window_draw_list()
        draw.add_rect_filled(low, ImVec2(low.x + 5, low.y + size.y), theme.u32(color), 3)
        imgui.text_colored(ImVec4(*color), icon)
        imgui.same_line()
        imgui.push_text_wrap_pos(TOAST_WIDTH - 50)
        imgui.text_wrapped(notice.title)
        imgui.pop_text_wrap_pos()
        imgui.same_line(TOAST_WIDTH - 40)
        imgui.push_style_color(imgui.Col_.button, ImVec4(0, 0, 0, 0))
        is_dismissed = imgui.small_button(f"{Icon.CLOSE}##close")
        imgui.pop_style_color()
        ui.mark(f"notice{index}.close")
        imgui.push_text_wrap_pos(TOAST_WIDTH - 20)
        if notice.detail:
            imgui.text_colored(ImVec4(*theme.TEXT_DIM), notice.detail)
        if notice.hint:
            imgui.text(notice.hint)
        imgui.pop_text_wrap_pos()
        if notice.kind == "error":
            if imgui.small_button(f"{Icon.COPY}  Copy"):
                imgui.set_clipboard_text(notice_text(notice))
            ui.mark(f"notice{index}.copy")
        height = imgui.get_window_size().y
        imgui.end()
        imgui.pop_style_color()
        if is_dismissed:
            dispatch(DismissNotice(index))
        return height
