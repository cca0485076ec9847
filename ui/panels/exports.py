"""The exports panel: those being written, waiting and ended, each with the commands for it."""

from __future__ import annotations

from imgui_bundle import ImVec2, ImVec4, imgui

from app.export.queue.export_status import ExportStatus
from app.session.commands import Command
from app.session.export_commands import (
    AskExport,
    CancelExport,
    ClearExports,
    MoveExport,
    RemoveExport,
    RetryExport,
    ShowExport,
)
from app.session.session_view import SessionView
from engine.text import duration_text, one_line, size_text
from ui.panels.pieces.widgets import elided, elided_path, primary_button, text_wrapped, text_wrapped_dim
from ui.panels.state import Dispatch, UiState
from ui.style import theme
from ui.style.colors import Color
from ui.style.numbers import format_count
from ui.style.theme import Icon

REFRESH_S = 0.25
BAR_WIDTH = 220.0
WIDE = 620.0
"""In a panel at least so wide the buttons stand at the end of the first line."""
BUTTONS_WIDTH = 215.0
EMPTY = "Exports are listed here: Gaussians, videos, players, figures, cameras."


# ---- words -----------------------------------------------------------------------------------------------------


def bytes_text(n_bytes: float) -> str:
    """An amount of data, in two or three digits."""
    if n_bytes < 1e3:
        return f"{n_bytes:.0f} bytes"
    return f"{n_bytes / 1e3:.0f} kB" if n_bytes < 1e5 else size_text(n_bytes / 1e6)


def files_text(n_files: int, n_bytes: float) -> str:
    """Files and their contents."""
    files = "1 file" if n_files == 1 else f"{format_count(n_files)} files"
    return f"{files}, {bytes_text(n_bytes)}"


def progress_text(status: ExportStatus) -> str:
    """How far an export is, how fast, and how long the rest takes."""
    if status.state == "waiting":
        return "Waiting"
    if status.state == "stopping":
        return "Stopping"
    progress = status.progress
    if progress is None:
        return "Starting"
    if not progress.n_all:
        return progress.message or "Starting"
    parts = [f"{format_count(progress.n_done)} of {format_count(progress.n_all)} {progress.unit}"]
    if status.per_s > 0:
        parts.append(f"{status.per_s:.1f} per second")
    if status.eta_s is not None and progress.n_done < progress.n_all:
        parts.append(f"{duration_text(status.eta_s)} left")
    return "; ".join(filter(None, (", ".join(parts), progress.message)))


def ending_text(status: ExportStatus) -> str:
    """Result of an export that has ended."""
    if status.state == "cancelled":
        return "Cancelled; no files were left."
    if status.state == "failed" or status.result is None:
        return " ".join(filter(None, (status.message, status.hint)))
    result = status.result
    said = f"{files_text(result.n_files, result.n_bytes)} in {duration_text(status.seconds)}"
    return said if result.psnr_db is None else f"{said}; read back: {result.psnr_db:.1f} dB PSNR"


_LOOKS = {
    "waiting": Icon.CLOCK,
    "running": Icon.PLAY,
    "stopping": Icon.STOP,
    "done": Icon.CHECK,
    "failed": Icon.WARNING,
    "cancelled": Icon.CLOSE,
}


def _color(status: ExportStatus) -> Color:
    colors = {"done": theme.GREEN, "failed": theme.ORANGE, "running": theme.SKY, "stopping": theme.SKY}
    return colors.get(status.state, theme.TEXT_DIM)


# ---- the panel -------------------------------------------------------------------------------------------------


def draw_exports(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """The button that asks for an export, and the list."""
    statuses = session.exporting.statuses
    if any(status.state in ("running", "stopping") for status in statuses):
        ui.redraw_within(REFRESH_S)
    imgui.begin_disabled(session.capture is None)
    if primary_button(f"{Icon.DROP}  Export ...", ImVec2(150, 0), ui):
        dispatch(AskExport())
    ui.mark("exports.ask")
    imgui.end_disabled()
    if any(status.is_over for status in statuses):
        imgui.same_line()
        if imgui.button("Clear the list##exports"):
            dispatch(ClearExports())
        ui.mark("exports.clear")
        imgui.set_item_tooltip("Removes ended exports from the list; files stay")
    if not statuses:
        text_wrapped_dim(EMPTY)
        return
    waiting = [status.export_id for status in statuses if status.state == "waiting"]
    if imgui.begin_child("##exports", ImVec2(0, 0), imgui.ChildFlags_.nav_flattened):
        for status in statuses:
            imgui.push_id(status.export_id)
            command = _draw_row(status, waiting, ui)
            imgui.pop_id()
            if command is not None:
                dispatch(command)
    imgui.end_child()


def _draw_row(status: ExportStatus, waiting: list[int], ui: UiState) -> Command | None:
    width = imgui.get_content_region_avail().x
    is_wide = width >= WIDE
    imgui.separator()
    imgui.text_colored(ImVec4(*_color(status)), _LOOKS[status.state])
    imgui.same_line()
    imgui.text(elided(status.title, width - 30))
    ui.mark(f"exports.title{status.export_id}")
    path_width, command = width, None
    if is_wide:
        imgui.same_line(0, 16)
        path_width = imgui.get_content_region_avail().x - BUTTONS_WIDTH - 16
    imgui.push_style_color(imgui.Col_.text, ImVec4(*theme.TEXT_DIM))
    imgui.text(elided_path(one_line(str(status.path)), path_width))
    imgui.pop_style_color()
    if is_wide:
        imgui.same_line(width - BUTTONS_WIDTH)
        command = _draw_buttons(status, waiting, ui)
    if status.is_over:
        text_wrapped(ending_text(status))
        ui.mark(f"exports.ending{status.export_id}")
        for line in () if status.result is None else status.result.lines:
            imgui.push_style_color(imgui.Col_.text, ImVec4(*theme.TEXT_DIM))
            text_wrapped(line)
            imgui.pop_style_color()
    else:
        if status.state != "waiting":
            imgui.progress_bar(status.done, ImVec2(BAR_WIDTH, imgui.get_text_line_height()), "")
            imgui.same_line()
        text_wrapped(progress_text(status))
        ui.mark(f"exports.progress{status.export_id}")
    return command if is_wide else _draw_buttons(status, waiting, ui)


def _draw_buttons(status: ExportStatus, waiting: list[int], ui: UiState) -> Command | None:
    export_id = status.export_id
    command: Command | None = None
    if not status.is_over:
        imgui.begin_disabled(status.state == "stopping")
        if _button(f"{Icon.STOP}  Cancel", "cancel", export_id, ui):
            command = CancelExport(export_id)
        imgui.end_disabled()
    if status.state == "done":
        if _button(f"{Icon.FOLDER}  Show in folder", "show", export_id, ui):
            command = ShowExport(export_id)
    elif status.is_over and _button(f"{Icon.LOOP}  Try again", "retry", export_id, ui):
        command = RetryExport(export_id)
    if status.is_over:
        imgui.same_line()
        if _button("Remove", "remove", export_id, ui):
            command = RemoveExport(export_id)
        imgui.set_item_tooltip("Removes it from the list; its files stay")
    if status.state == "waiting":
        place = waiting.index(export_id)
        for icon, name, step, is_possible in (
            (Icon.UP, "up", -1, place > 0),
            (Icon.DOWN, "down", 1, place < len(waiting) - 1),
        ):
            imgui.same_line()
            imgui.begin_disabled(not is_possible)
            if _button(icon, name, export_id, ui):
                command = MoveExport(export_id, place + step)
            imgui.set_item_tooltip("Earlier" if step < 0 else "Later")
            imgui.end_disabled()
    return command


def _button(label: str, name: str, export_id: int, ui: UiState) -> bool:
    is_clicked = imgui.small_button(f"{label}##{name}")
    ui.mark(f"exports.{name}{export_id}")
    return is_clicked
