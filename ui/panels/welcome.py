"""What the viewport shows before a capture is open: how to open one, and the sample."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from imgui_bundle import ImVec2, ImVec4, imgui

from app.commands import OpenCapture
from ui import theme
from ui.state import Dispatch, Rect, UiState
from ui.theme import Icon
from ui.widgets import pop_bold, primary_button, push_bold, text_wrapped_dim

SAMPLE_PATH = Path(__file__).resolve().parents[2] / "assets" / "sample"
CARD_SIZE = (520.0, 380.0)
MAX_RECENT = 3


def draw_welcome(session: Any, dispatch: Dispatch, ui: UiState, area: Rect) -> None:
    """A card in the middle of the area."""
    x, y = area.center
    width, height = min(CARD_SIZE[0], area.width - 24), min(CARD_SIZE[1], area.height - 24)
    imgui.set_cursor_screen_pos(ImVec2(x - width / 2, y - height / 2))
    imgui.push_style_color(imgui.Col_.child_bg, ImVec4(*theme.PANEL))
    padding = (36, 30) if height == CARD_SIZE[1] else (20, 14)
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(*padding))
    imgui.begin_child("welcome", ImVec2(width, height), imgui.ChildFlags_.always_use_window_padding)
    imgui.pop_style_var()
    push_bold(ui, ui.fonts.title_size)
    imgui.text("ClipGStream Studio")
    pop_bold(ui)
    text_wrapped_dim(
        "See a multi-camera capture in space and time. Open a folder, train it clip by clip, and watch it sharpen."
    )
    imgui.dummy(ImVec2(0, 8))
    is_busy = bool(session.jobs)
    imgui.begin_disabled(is_busy)
    if primary_button(f"{Icon.FOLDER}  Open a capture folder", ImVec2(-1, 40), ui):
        ui.is_open_requested = True
    ui.mark("welcome.open")
    if SAMPLE_PATH.is_dir():
        if imgui.button(f"{Icon.FILM}  Open the sample capture", ImVec2(-1, 36)):
            dispatch(OpenCapture(SAMPLE_PATH))
        ui.mark("welcome.sample")
    imgui.end_disabled()
    imgui.dummy(ImVec2(0, 4))
    if is_busy:
        job = session.jobs[0]
        imgui.text(f"{job.name}  {job.message}")
        imgui.progress_bar(min(max(job.done, 0.0), 1.0), ImVec2(-1, 6), "")
    else:
        _draw_recent(session, dispatch, ui)
        imgui.text_disabled(f"{Icon.DROP}  or drop a folder on this window")
        imgui.text_disabled(f"{Icon.HELP}  F1 shows every key")
    imgui.end_child()
    imgui.pop_style_color()


def _draw_recent(session: Any, dispatch: Dispatch, ui: UiState) -> None:
    recent = [Path(folder) for folder in session.settings.recent if Path(folder) != SAMPLE_PATH][:MAX_RECENT]
    for i, folder in enumerate(recent):
        if imgui.selectable(f"{Icon.CLOCK}  {folder.name}##recent{i}", False)[0]:
            dispatch(OpenCapture(folder))
        ui.mark(f"welcome.recent{i}")
        imgui.set_item_tooltip(str(folder))
