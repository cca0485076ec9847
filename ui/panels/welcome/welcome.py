"""The viewport before a capture is open: how to open one, and the sample."""

from __future__ import annotations

import time

from imgui_bundle import ImVec2, ImVec4, imgui

from app.session.projects.project_commands import OpenCapture
from app.session.session_view import SessionView
from engine.assets import asset_path
from ui.panels.pieces.widgets import draw_job_bar, pop_bold, primary_button, push_bold, text_right, text_wrapped_dim
from ui.panels.state import Dispatch, Rect, UiState
from ui.panels.welcome.recent_rows import RecentRows
from ui.style import theme
from ui.style.progress_words import job_words
from ui.style.theme import Icon

SAMPLE_PATH = asset_path("sample")
CARD_SIZE = (680.0, 580.0)
HINTS_WIDTH = 560.0
"""In a card at least this wide both hints stand in one line."""


def draw_welcome(session: SessionView, dispatch: Dispatch, ui: UiState, area: Rect, rows: RecentRows) -> None:
    """A card in the middle of the area. rows: Owns the pictures of recent projects."""
    x, y = area.center
    width, height = min(CARD_SIZE[0], area.width - 24), min(CARD_SIZE[1], area.height - 24)
    imgui.set_cursor_screen_pos(ImVec2(x - width / 2, y - height / 2))
    imgui.push_style_color(imgui.Col_.child_bg, ImVec4(*theme.PANEL))
    padding = (36, 30) if height == CARD_SIZE[1] else (20, 14)
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(*padding))
    imgui.begin_child(
        "welcome", ImVec2(width, height), imgui.ChildFlags_.always_use_window_padding | imgui.ChildFlags_.nav_flattened
    )
    imgui.pop_style_var()
    push_bold(ui, ui.fonts.title_size)
    imgui.text("ClipGStream Studio")
    pop_bold(ui)
    text_wrapped_dim(
        "See a multi-camera capture in space and time. Open a capture, train it clip by clip, and watch it sharpen."
    )
    imgui.dummy(ImVec2(0, 8))
    is_busy = bool(session.jobs)
    imgui.begin_disabled(is_busy)
    if primary_button(f"{Icon.FOLDER}  Open a capture or project folder", ImVec2(-1, 40), ui):
        ui.is_open_requested = True
    ui.mark("welcome.open")
    has_sample = SAMPLE_PATH.is_dir()
    half = (imgui.get_content_region_avail().x - imgui.get_style().item_spacing.x) / 2
    if imgui.button(f"{Icon.CAMERA}  Calibrate plain videos ...", ImVec2(half if has_sample else -1, 36)):
        ui.wishes.is_calibration = True
    ui.mark("welcome.calibrate")
    if has_sample:
        imgui.same_line()
        if imgui.button(f"{Icon.FILM}  Try the sample", ImVec2(-1, 36)):
            dispatch(OpenCapture(SAMPLE_PATH))
        ui.mark("welcome.sample")
    imgui.end_disabled()
    imgui.dummy(ImVec2(0, 4))
    if is_busy:
        job = session.jobs[0]
        imgui.text(f"{job.name}: {job_words(job, time.monotonic())}")
        draw_job_bar(job, ui, -1.0, 6.0)
    else:
        _draw_recent(session, dispatch, ui, rows)
        imgui.text_disabled(f"{Icon.DROP}  or drop a folder on this window")
        hint = f"{Icon.HELP}  F1 shows every key, Ctrl+K finds every action"
        if imgui.get_content_region_avail().x > HINTS_WIDTH:
            text_right(hint)
    imgui.end_child()
    imgui.pop_style_color()


def _draw_recent(session: SessionView, dispatch: Dispatch, ui: UiState, rows: RecentRows) -> None:
    """The list, as high as there is room for; it scrolls."""
    if session.recent.entries:
        imgui.text_disabled("Recent")
    height = max(imgui.get_content_region_avail().y - imgui.get_text_line_height_with_spacing() - 4, 40.0)
    if imgui.begin_child("recent", ImVec2(0, height), imgui.ChildFlags_.nav_flattened):
        rows.draw(session.recent, dispatch, ui)
    imgui.end_child()
