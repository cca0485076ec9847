"""What the viewport shows before a capture is open: how to open one, and the sample."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from imgui_bundle import ImVec2, ImVec4, imgui

from app.project.recents import RecentProject
from app.session.commands import ForgetRecent, OpenCapture, OpenProject
from app.status import JobStatus
from ui.panels.state import Dispatch, Rect, UiState
from ui.panels.widgets import elided_path, pop_bold, primary_button, push_bold, text_wrapped_dim
from ui.style import theme
from ui.style.theme import Icon

SAMPLE_PATH = Path(__file__).resolve().parents[2] / "assets" / "sample"
CARD_SIZE = (560.0, 440.0)
MAX_RECENT = 4
RECENT_HEIGHT = 34.0


class RecentList(Protocol):
    """What was opened lately."""

    @property
    def entries(self) -> Sequence[RecentProject]: ...

    @property
    def missing(self) -> frozenset[Path]: ...


class WelcomeNeeds(Protocol):
    """What the first screen reads."""

    @property
    def jobs(self) -> Sequence[JobStatus]: ...

    @property
    def recent(self) -> RecentList: ...


def draw_welcome(session: WelcomeNeeds, dispatch: Dispatch, ui: UiState, area: Rect) -> None:
    """A card in the middle of the area."""
    x, y = area.center
    width, height = min(CARD_SIZE[0], area.width - 24), min(CARD_SIZE[1], area.height - 24)
    imgui.set_cursor_screen_pos(ImVec2(x - width / 2, y - height / 2))
    imgui.push_style_color(imgui.Col_.child_bg, ImVec4(*theme.PANEL))
    padding = (36, 30) if height == CARD_SIZE[1] else (20, 14)
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(*padding))
    imgui.begin_child("welcome", ImVec2(width, height), imgui.ChildFlags_.always_use_window_padding | imgui.ChildFlags_.nav_flattened)
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


def open_recent(entry: RecentProject) -> OpenProject | OpenCapture:
    """What opens an entry of the list of recent projects."""
    return OpenProject(entry.folder) if entry.project else OpenCapture(entry.folder)


def _draw_recent(session: WelcomeNeeds, dispatch: Dispatch, ui: UiState) -> None:
    """One row per project: its name and how far it is trained, its path; those that are gone can be removed."""
    for index, entry in enumerate(session.recent.entries[:MAX_RECENT]):
        _draw_recent_row(index, entry, session, dispatch, ui)


def _draw_recent_row(index: int, entry: RecentProject, session: WelcomeNeeds, dispatch: Dispatch, ui: UiState) -> None:
    is_gone = entry.folder in session.recent.missing
    start, width = imgui.get_cursor_pos(), imgui.get_content_region_avail().x
    row = ImVec2(width - (34 if is_gone else 0), RECENT_HEIGHT)
    imgui.begin_disabled(is_gone)
    if imgui.selectable(f"##recent{index}", False, imgui.SelectableFlags_.none, row)[0]:
        dispatch(open_recent(entry))
    imgui.end_disabled()
    ui.mark(f"welcome.recent{index}")
    if imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_disabled):
        imgui.set_tooltip(f"{entry.folder}\n{'It is not there any more.' if is_gone else entry.trained_text}")
    end = imgui.get_cursor_pos()
    words = "not found" if is_gone else entry.trained_text
    right = start.x + row.x - imgui.calc_text_size(words).x - 6
    imgui.set_cursor_pos(ImVec2(start.x, start.y))
    imgui.text_colored(ImVec4(*(theme.TEXT_DIM if is_gone else theme.TEXT)), f"{Icon.CLOCK}  {entry.name}")
    imgui.set_cursor_pos(ImVec2(right, start.y))
    imgui.text_colored(ImVec4(*(theme.ORANGE if is_gone else theme.TEXT_DIM)), words)
    imgui.set_cursor_pos(ImVec2(start.x + 23, start.y + 16))
    imgui.push_font(None, ui.fonts.small_size)
    imgui.text_disabled(elided_path(str(entry.folder), row.x - 30))
    imgui.pop_font()
    if is_gone:
        imgui.set_cursor_pos(ImVec2(start.x + width - 28, start.y + 4))
        if imgui.button(f"{Icon.CLOSE}##forget{index}", ImVec2(26, 26)):
            dispatch(ForgetRecent(entry.folder))
        ui.mark(f"welcome.forget{index}")
        imgui.set_item_tooltip("Take it out of this list")
    imgui.set_cursor_pos(end)
    imgui.dummy(ImVec2(0, 0))
