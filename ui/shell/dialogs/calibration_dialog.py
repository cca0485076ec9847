"""The dialog that makes a capture of plain videos: the cameras found, how they are calibrated, progress, the result.

Enter continues, Escape goes back: it stops a calibration that runs, and closes the dialog otherwise.
"""

from __future__ import annotations

import time
from pathlib import Path

from imgui_bundle import ImVec2, ImVec4, imgui

from app.calibration.job import CalibrationRequest
from app.session.captures.calibration_page import CalibrationPage, CalibrationResult, VideoFacts
from app.session.captures.capture_commands import CalibrateVideos, KeepCalibration, StopCalibration
from app.session.commands import CloseQuestion, Command
from app.session.projects.project_commands import OpenCapture
from app.session.session_view import SessionView
from app.status import JobStatus
from engine.calibration.options import LENSES, UPS, CalibrationOptions, KnownDistance, Lens, Up
from engine.text import rate_text
from ui.panels.pieces.widgets import (
    draw_job_bar,
    elided,
    elided_path,
    pop_bold,
    primary_button,
    push_bold,
    text_wrapped,
    text_wrapped_dim,
)
from ui.panels.state import Dispatch, UiState
from ui.shell.dialogs.modal import Modal
from ui.style import theme
from ui.style.progress_words import job_words
from ui.style.theme import Icon

TITLE = "Calibrate plain videos###calibration"
SIZE = (860.0, 620.0)
BUTTON = ImVec2(190, 34)
LABEL_WIDTH = 150.0
FIELD_WIDTH = 330.0
LENS_WORDS: dict[Lens, str] = {"simple": "Ordinary", "opencv": "Wide angle", "fisheye": "Fisheye"}
UP_WORDS: dict[Up, str] = {"floor": "The floor", "cameras": "The cameras"}
ABOUT = (
    "Finds camera poses and lenses from the pictures alone. The cameras must not move, and neighbouring views must "
    "overlap."
)


class CalibrationDialog:
    """Owns the choices so far."""

    def __init__(self) -> None:
        self._folder: Path | None = None
        self._modal = Modal()
        self._lens: Lens = "simple"
        self._up: Up = "floor"
        self._is_shared = self._is_replacing = self._has_distance = False
        self._pair, self._metres = (0, 1), 1.0
        self._out = ""

    def draw(self, session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        """Draw the dialog while there is a folder to be calibrated."""
        page = session.calibrating.page
        keys = self._modal.begin(None if page is None else TITLE, TITLE, SIZE)
        if keys is None or page is None:
            return
        if not keys.is_up:
            dispatch(CloseQuestion())
            return
        if page.folder != self._folder:
            self._folder, self._out, self._pair = page.folder, str(page.folder), (0, 1)
            self._is_replacing = self._has_distance = False
        answer: Command | None = None
        if keys.is_closed:
            answer = CloseQuestion()
        elif page.state == "running":
            answer = self._draw_running(page, session.calibrating.progress, ui, is_left=keys.is_left)
        elif page.state == "done" and page.result is not None:
            answer = _draw_result(page, page.result, ui, is_agreed=keys.is_agreed)
        else:
            answer = self._draw_questions(page, ui, is_agreed=keys.is_agreed)
        if answer is None and keys.is_left and page.state != "running":
            answer = CloseQuestion()
        if isinstance(answer, CloseQuestion | OpenCapture):
            imgui.close_current_popup()
        imgui.end_popup()
        if answer is not None:
            dispatch(answer)

    # ---- before

    def _draw_questions(self, page: CalibrationPage, ui: UiState, *, is_agreed: bool) -> Command | None:
        if imgui.begin_child("questions", ImVec2(0, -(BUTTON.y + 18)), imgui.ChildFlags_.nav_flattened):
            _draw_head(page, ui)
            text_wrapped_dim(ABOUT)
            if page.state == "looking":
                text_wrapped_dim("Reading the folder ...")
                ui.redraw_within(0.1)
            if page.failure is not None:
                _draw_failure(page, ui)
            if page.cameras:
                _draw_cameras(page.cameras)
                self._draw_options(page, ui, is_fixed=is_agreed)
        imgui.end_child()
        imgui.separator()
        imgui.set_cursor_pos_x(imgui.get_window_width() - 2 * BUTTON.x - 22)
        if imgui.button("Cancel", BUTTON):
            return CloseQuestion()
        ui.mark("calibration.cancel")
        imgui.same_line()
        is_possible = bool(page.cameras) and (self._is_replacing or not self._would_replace(page))
        imgui.begin_disabled(not is_possible)
        is_clicked = primary_button("Calibrate", BUTTON, ui)
        ui.mark("calibration.start")
        imgui.set_item_default_focus()
        imgui.end_disabled()
        return CalibrateVideos(self.request(page)) if is_possible and (is_clicked or is_agreed) else None

    def request(self, page: CalibrationPage) -> CalibrationRequest:
        """The chosen options."""
        distance = None
        if self._has_distance:
            first, second = (page.cameras[row].name for row in self._pair)
            distance = KnownDistance(first, second, self._metres)
        out = Path(self._out).expanduser() if self._out.strip() else page.folder
        return CalibrationRequest(
            videos=page.folder,
            out=None if out == page.folder else out,
            options=CalibrationOptions(self._lens, self._is_shared, distance, self._up),
            is_replacing=self._is_replacing,
        )

    def _would_replace(self, page: CalibrationPage) -> bool:
        return page.has_capture_json and self._out.strip() in ("", str(page.folder))

    def _draw_options(self, page: CalibrationPage, ui: UiState, *, is_fixed: bool) -> None:
        before = self._is_shared, self._is_replacing, self._has_distance
        imgui.spacing()
        _label("Lenses")
        for name, words in LENS_WORDS.items():
            if imgui.radio_button(f"{words}##lens{name}", self._lens == name) and not is_fixed:
                self._lens = name
            ui.mark(f"calibration.lens.{name}")
            imgui.set_item_tooltip(LENSES[name])
            imgui.same_line()
        imgui.new_line()
        _label("")
        self._is_shared = imgui.checkbox("All cameras are the same model at the same zoom", self._is_shared)[1]
        ui.mark("calibration.shared")
        _label("Up is given by")
        for name, words in UP_WORDS.items():
            if imgui.radio_button(f"{words}##up{name}", self._up == name) and not is_fixed:
                self._up = name
            ui.mark(f"calibration.up.{name}")
            imgui.set_item_tooltip(UPS[name])
            imgui.same_line()
        imgui.new_line()
        _label("Known distance")
        self._has_distance = imgui.checkbox("The distance between two lenses was measured", self._has_distance)[1]
        ui.mark("calibration.distance")
        if self._has_distance:
            _label("")
            self._pair = (_camera_box("##first", page.cameras, self._pair[0]), self._pair[1])
            imgui.same_line()
            imgui.text_disabled("to")
            imgui.same_line()
            self._pair = (self._pair[0], _camera_box("##second", page.cameras, self._pair[1]))
            imgui.same_line()
            imgui.set_next_item_width(80)
            self._metres = max(imgui.input_float("metres##known", self._metres, 0.0, 0.0, "%.4g")[1], 1e-3)
            ui.mark("calibration.metres")
        _label("Output")
        imgui.set_next_item_width(FIELD_WIDTH + 90)
        self._out = imgui.input_text("##out", self._out)[1]
        ui.mark("calibration.out")
        imgui.set_item_tooltip("A small file, capture.json; the videos do not change.")
        if self._would_replace(page):
            _label("")
            self._is_replacing = imgui.checkbox("Replace the existing capture.json", self._is_replacing)[1]
            ui.mark("calibration.replace")
        if is_fixed:
            self._is_shared, self._is_replacing, self._has_distance = before

    # ---- while it runs

    def _draw_running(
        self, page: CalibrationPage, progress: JobStatus | None, ui: UiState, *, is_left: bool
    ) -> Command | None:
        if imgui.begin_child("running", ImVec2(0, -(BUTTON.y + 18)), imgui.ChildFlags_.nav_flattened):
            _draw_head(page, ui)
            _draw_cameras(page.cameras)
            imgui.spacing()
            imgui.text(job_words(progress, time.monotonic()))
            ui.mark("calibration.stage")
            draw_job_bar(progress, ui, -1.0, 12.0)
            ui.mark("calibration.progress")
            text_wrapped_dim("Escape stops it; nothing is written.")
        imgui.end_child()
        imgui.separator()
        imgui.set_cursor_pos_x(imgui.get_window_width() - BUTTON.x - 14)
        is_clicked = imgui.button("Stop", BUTTON)
        ui.mark("calibration.stop")
        return StopCalibration() if is_clicked or is_left else None


def _draw_result(page: CalibrationPage, result: CalibrationResult, ui: UiState, *, is_agreed: bool) -> Command | None:
    if imgui.begin_child("result", ImVec2(0, -(BUTTON.y + 18)), imgui.ChildFlags_.nav_flattened):
        _draw_head(page, ui)
        is_fine = not (result.missing or result.has_doubts or result.failure)
        color, icon = (theme.GREEN, Icon.CHECK) if is_fine else (theme.ORANGE, Icon.WARNING)
        imgui.text_colored(ImVec4(*color), icon)
        imgui.same_line()
        if result.failure:
            text_wrapped(f"Calibration failed; nothing was written. {result.failure}")
        for line in lines_below(result):
            text_wrapped_dim(line) if line.startswith("  ") else text_wrapped(line)
    imgui.end_child()
    imgui.separator()
    is_copied = imgui.button(f"{Icon.COPY}  Copy the report", ImVec2(0, BUTTON.y))
    ui.mark("calibration.copy")
    if is_copied and not is_agreed:
        imgui.set_clipboard_text("\n".join(result.lines))
    imgui.same_line(imgui.get_window_width() - 2 * BUTTON.x - 22)
    if result.failure:
        return _draw_failed_answers(ui, is_agreed=is_agreed)
    return _draw_answers(result, ui, is_agreed=is_agreed)


def _draw_answers(result: CalibrationResult, ui: UiState, *, is_agreed: bool) -> Command | None:
    if imgui.button("Close", BUTTON):
        return CloseQuestion()
    imgui.same_line()
    is_clicked = primary_button("Open the capture", BUTTON, ui)
    ui.mark("calibration.open")
    imgui.set_item_default_focus()
    if is_clicked or is_agreed:
        return OpenCapture(result.capture, follow_links=result.needs_links, is_asking=True)
    return None


def lines_below(result: CalibrationResult) -> list[str]:
    """The report without the sentence that stands above it already, where the calibration has failed."""
    return [line for line in result.lines if line != result.failure]


def _draw_failed_answers(ui: UiState, *, is_agreed: bool) -> Command | None:
    """Enter closes: a failed calibration is kept only where that is chosen."""
    is_kept = imgui.button("Keep anyway", BUTTON)
    ui.mark("calibration.keep")
    imgui.set_item_tooltip("Writes capture.json with all cameras in use, for inspection.")
    imgui.same_line()
    is_closed = primary_button("Close", BUTTON, ui)
    ui.mark("calibration.close")
    imgui.set_item_default_focus()
    if is_closed or is_agreed:
        return CloseQuestion()
    return KeepCalibration() if is_kept else None


def _draw_head(page: CalibrationPage, ui: UiState) -> None:
    width = imgui.get_content_region_avail().x
    push_bold(ui, ui.fonts.body_size + 2)
    imgui.text(elided(page.folder.name or str(page.folder), width))
    pop_bold(ui)
    imgui.text_disabled(elided_path(str(page.folder), width))
    imgui.spacing()


def _draw_failure(page: CalibrationPage, ui: UiState) -> None:
    failure = page.failure
    assert failure is not None
    imgui.spacing()
    imgui.text_colored(ImVec4(*theme.ORANGE), Icon.WARNING)
    imgui.same_line()
    text_wrapped(failure.message)
    if failure.hint:
        text_wrapped(failure.hint)
    for message, hint in failure.problems:
        text_wrapped_dim(" ".join(part for part in (message, hint) if part))
    if imgui.small_button(f"{Icon.COPY}  Copy"):
        imgui.set_clipboard_text(failure.text)
    ui.mark("calibration.copy_failure")


def _draw_cameras(cameras: tuple[VideoFacts, ...]) -> None:
    imgui.spacing()
    imgui.text(f"{len(cameras)} cameras")
    lines = max(min(len(cameras), 6), 1)
    height = lines * imgui.get_text_line_height_with_spacing() + 8
    imgui.push_style_color(imgui.Col_.child_bg, ImVec4(*theme.BACKDROP))
    if imgui.begin_child("cameras", ImVec2(0, height), imgui.ChildFlags_.nav_flattened) and imgui.begin_table(
        "cams", 4
    ):
        for camera in cameras:
            imgui.table_next_row()
            imgui.table_next_column()
            imgui.text(f" {camera.name}")
            imgui.table_next_column()
            imgui.text_disabled(f"{camera.image_size[0]} x {camera.image_size[1]}")
            imgui.table_next_column()
            imgui.text_disabled(f"{camera.n_frames:,} frames")
            imgui.table_next_column()
            imgui.text_disabled(f"{rate_text(camera.fps)} fps" if camera.fps else "")
        imgui.end_table()
    imgui.end_child()
    imgui.pop_style_color()
    counts = {camera.n_frames for camera in cameras}
    if len(counts) > 1:
        text_wrapped_dim(f"Their lengths differ; the {min(counts):,} frames they share are used.")


def _camera_box(label: str, cameras: tuple[VideoFacts, ...], chosen: int) -> int:
    chosen = min(chosen, len(cameras) - 1)
    imgui.set_next_item_width(110)
    if imgui.begin_combo(label, cameras[chosen].name):
        for row, camera in enumerate(cameras):
            imgui.push_id(row)
            if imgui.selectable(f"{camera.name}##camera", row == chosen)[0]:
                chosen = row
            imgui.pop_id()
        imgui.end_combo()
    return chosen


def _label(text: str) -> None:
    imgui.align_text_to_frame_padding()
    imgui.text(text)
    imgui.same_line(LABEL_WIDTH)
