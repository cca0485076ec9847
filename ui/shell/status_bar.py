"""The line at the bottom of the window: the program's work at the moment, and how it draws."""

from __future__ import annotations

import time

from imgui_bundle import ImVec2, ImVec4, imgui

from app.session.commands import CancelJob
from app.session.session_view import SessionView
from engine.text import duration_text
from ui.panels.pieces.widgets import draw_job_bar, elided
from ui.panels.state import Dispatch, UiState
from ui.panels.training.queue import clips_text, usage_text
from ui.panels.training.running import is_listed
from ui.style import theme
from ui.style.numbers import format_count
from ui.style.progress_words import job_words, stage_words, whole_words
from ui.style.theme import Icon

HEIGHT = 28.0
BAR_WIDTH = 90.0


def draw_status_bar(session: SessionView, dispatch: Dispatch, ui: UiState, *, is_software: bool) -> None:
    """Work and its progress on the left; notices and the kind of drawing on the right."""
    flags = imgui.WindowFlags_.no_scrollbar | imgui.WindowFlags_.no_saved_settings | imgui.WindowFlags_.no_docking
    imgui.push_style_color(imgui.Col_.window_bg, ImVec4(*theme.BACKDROP))
    imgui.push_style_color(imgui.Col_.text, ImVec4(*theme.TEXT_DIM))
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(14, 5))
    viewport = imgui.get_main_viewport()
    if imgui.internal.begin_viewport_side_bar("##status", viewport, imgui.Dir.down, HEIGHT, flags):
        right = _right_text(session, is_software=is_software)
        right_x = imgui.get_window_width() - imgui.calc_text_size(right).x - 14
        start, left = imgui.get_cursor_pos(), 0.0
        if session.jobs:
            left = BAR_WIDTH + imgui.get_style().item_spacing.x
            imgui.set_cursor_pos_x(start.x + left)
            if session.jobs[0].can_cancel:
                if imgui.small_button("Cancel##job"):
                    dispatch(CancelJob(session.jobs[0].name))
                ui.mark("status.cancel")
                imgui.same_line()
                left = imgui.get_cursor_pos_x() - 14
        imgui.text(elided(status_text(session), right_x - left - 28))
        ui.mark("status.text")
        imgui.same_line(max(right_x, 0))
        imgui.text(right)
        if session.jobs:  # last, since what follows a bar in its line stands lower
            imgui.set_cursor_pos(start)
            draw_job_bar(session.jobs[0], ui, BAR_WIDTH, imgui.get_text_line_height())
    imgui.end()
    imgui.pop_style_var()
    imgui.pop_style_color(2)


def status_text(session: SessionView) -> str:
    """Current activity, in one line."""
    if session.jobs:
        job = session.jobs[0]
        return f"{job.name}: {job_words(job, time.monotonic())}"
    status = session.training
    if is_listed(session):
        return f"Training: {whole_words(len(session.clips), status, session.queue)}"
    if status.state == "running":
        steps = f"step {format_count(status.step)} of {format_count(status.n_steps)}"
        queued = session.queue.queued
        rest = ""
        if queued is not None and queued.n_clips > 1:
            rest = f"; {clips_text(queued.n_clips)}, {duration_text(queued.seconds)} in all"
        return f"Training clip {status.clip_index}: {steps}, {duration_text(status.eta_s)} left{rest}"
    if status.state in ("starting", "preparing", "stopping", "paused"):
        words = {"starting": "Starting", "preparing": "Preparing", "stopping": "Stopping", "paused": "Paused:"}
        return f"{words[status.state]} clip {status.clip_index}  {stage_words(status)}  {status.message or ''}"
    if session.capture is None:
        return "Open a capture or a project to begin"
    trained = "" if session.project_status is None else session.project_status.trained_text
    selected = session.selection.words
    return f"{selected} selected    {trained}" if selected else trained


def _exports_text(session: SessionView) -> str:
    """How far the export is that runs, and that others wait; empty where none does."""
    left = [status for status in session.exporting.statuses if not status.is_over]
    if not left:
        return ""
    more = f" (1 of {len(left)})" if len(left) > 1 else ""
    return f"{Icon.DROP} {100 * left[0].done:.0f} %{more}    "


def _right_text(session: SessionView, *, is_software: bool) -> str:
    worst = [notice for notice in session.notices if notice.kind != "info"]
    notices = f"{Icon.WARNING} {len(worst)}    " if worst else ""
    usage = usage_text(session.usage)
    usage = f"{usage}    " if usage else ""
    return f"{notices}{_exports_text(session)}{usage}{'software drawing' if is_software else 'graphics card'}"
