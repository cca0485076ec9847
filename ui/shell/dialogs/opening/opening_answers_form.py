"""Questions about a capture that is opened: frames, size, clip length, held-out cameras; and a forecast."""

from __future__ import annotations

from dataclasses import replace

from imgui_bundle import ImVec2, imgui

from app.project.opening.capture_report import CaptureReport
from app.project.opening.opening_answers import OpeningAnswers
from app.session.questions import OpeningPage
from app.session.session_view import OpeningView
from app.status import OpeningForecast
from engine.capture.pixels.frame_fit import FrameFit
from engine.text import duration_text
from ui.panels.pieces.widgets import pop_bold, push_bold, text_wrapped_dim
from ui.panels.state import Rect, UiState
from ui.shell.dialogs.opening.opening_map import draw_map
from ui.style import theme
from ui.style.numbers import format_count
from ui.style.theme import Icon

FIELD_WIDTH = 84.0
LABEL_WIDTH = 118.0
MAP_SIDE = 190.0
LEAST_PERCENT = 5
_FIT_CHOICES: dict[FrameFit, str] = {
    "scaled": "Scaled",
    "cropped_end": "Cropped right and below",
    "cropped_start": "Cropped left and above",
    "cropped_middle": "Cropped on both sides",
}
"""Possible changes to frames of another shape than their calibration."""


class AnswersForm:
    """Owns the answers until they are taken. `answers` is always possible; see `CaptureOpening.problem`."""

    def __init__(self) -> None:
        self._page: OpeningPage | None = None
        self._first = self._last = 0
        self._percent = 100.0
        self._clip_length = 1
        self._holdout: set[str] = set()
        self._offered: tuple[str, ...] = ()
        self._fit: FrameFit | None = None
        self._pointed: str | None = None

    def begin(self, page: OpeningPage) -> None:
        """Begin with the offered answers, once for each page."""
        if page is self._page:
            return
        self._page, answers = page, page.answers
        first, stop = answers.frames or (0, page.report.n_frames)
        self._first, self._last, self._clip_length = first, stop - 1, answers.clip_length
        self._percent = 100.0 * answers.scale
        self._offered, self._holdout = answers.holdout, set(answers.holdout)
        self._fit = page.report.fit

    @property
    def answers(self) -> OpeningAnswers:
        """The present answers."""
        assert self._page is not None
        report, offered = self._page.report, self._page.answers
        frames = self._first, self._last + 1
        n_frames = frames[1] - frames[0]
        percent = self._percent
        return OpeningAnswers(
            frames=None if frames == (0, report.n_frames) else frames,
            scale=offered.scale if percent == 100.0 * offered.scale else percent / 100.0,
            clip_length=min(self._clip_length, n_frames),
            holdout=tuple(camera.name for camera in report.cameras if camera.name in self._holdout),
            fit=self._fit,
        )

    def draw(self, needs: OpeningView, ui: UiState, *, is_fixed: bool) -> None:
        """Draw the questions and the forecast. is_fixed: Enter was pressed, which accepts and changes nothing."""
        assert self._page is not None
        report = self._page.report
        forecast, is_final = needs.forecast(self.answers)
        before = replace(self.answers), set(self._holdout)
        self._draw_numbers(report, forecast, ui)
        self._draw_holdout(report, ui)
        if is_fixed:
            self._holdout = before[1]
        self._draw_forecast(forecast, needs.problem(self.answers), ui, is_final=is_final)

    def _draw_numbers(self, report: CaptureReport, forecast: OpeningForecast | None, ui: UiState) -> None:
        answers, last = self.answers, report.n_frames - 1
        _label("Frames")
        self._first = _whole_number("##first", self._first, 0, self._last)
        ui.mark("opening.first")
        imgui.same_line()
        imgui.text_disabled("to")
        imgui.same_line()
        self._last = _whole_number("##last", self._last, self._first, last)
        ui.mark("opening.last")
        n_frames = self._last - self._first + 1
        many = f"all {format_count(n_frames)}"
        if n_frames != report.n_frames:
            many = f"{format_count(n_frames)} of {format_count(report.n_frames)}"
        _said(f"{many}, {n_frames / max(report.fps, 1e-6):.1f} s")
        _label("Picture size")
        imgui.set_next_item_width(FIELD_WIDTH)
        is_changed, percent = imgui.input_float("##scale", self._percent, 0.0, 0.0, "%.4g %%")
        if is_changed:
            self._percent = min(max(percent, LEAST_PERCENT), 100.0)
        ui.mark("opening.scale")
        if forecast is not None:
            _said(f"{forecast.size[0]} x {forecast.size[1]} pixels")
        _label("Clip length")
        self._clip_length = _whole_number("##clip", answers.clip_length, 1, n_frames)
        ui.mark("opening.clip_length")
        n_clips = -(-n_frames // self._clip_length)
        seconds = self._clip_length / max(report.fps, 1e-6)
        _said(f"{format_count(n_clips)} clip{'' if n_clips == 1 else 's'} of {seconds:.2g} s")

        if report.misfit_px > 0:
            _label("Other shape")
            imgui.set_next_item_width(imgui.get_content_region_avail().x)
            chosen = self._fit or (None if report.needs_fit else "scaled")
            is_open = imgui.begin_combo("##fit", "Scaled or cropped?" if chosen is None else _FIT_CHOICES[chosen])
            ui.mark("opening.fit")
            if is_open:
                for fit, words in _FIT_CHOICES.items():
                    if imgui.selectable(words, fit == chosen)[0]:
                        self._fit = fit
                    ui.mark(f"opening.fit.{fit}")
                imgui.end_combo()

    def _draw_holdout(self, report: CaptureReport, ui: UiState) -> None:
        imgui.spacing()
        n_out = len(self._holdout)
        imgui.text(f"Held out for measuring: {n_out} of {len(report.cameras)} cameras")
        text_wrapped_dim("Training never sees them, so they measure its quality. Click a camera to change it.")
        corner = imgui.get_cursor_screen_pos()
        box = Rect(corner.x, corner.y, corner.x + MAP_SIDE, corner.y + MAP_SIDE)
        clicked = draw_map(report, frozenset(self._holdout), box, ui, self._pointed)
        if clicked is not None:
            self._holdout ^= {clicked}
        imgui.set_cursor_screen_pos(ImVec2(box.x1 + 10, box.y0))
        imgui.begin_group()
        if imgui.small_button("Default"):
            self._holdout = set(self._offered)
        ui.mark("opening.offered")
        imgui.same_line()
        if imgui.small_button("None"):
            self._holdout = set()
        ui.mark("opening.none")
        self._pointed = None
        height = MAP_SIDE - imgui.get_frame_height_with_spacing()
        if imgui.begin_child("cameras", ImVec2(0, height), imgui.ChildFlags_.nav_flattened):
            for row, camera in enumerate(report.cameras):
                imgui.push_id(row)
                is_out = camera.name in self._holdout
                is_changed, _ = imgui.checkbox("##out", is_out)
                ui.mark(f"opening.camera{row}")
                if imgui.is_item_hovered() or (imgui.is_item_focused() and imgui.get_io().nav_visible):
                    self._pointed = camera.name
                imgui.same_line()
                imgui.text(camera.name)
                if imgui.is_item_hovered():
                    self._pointed = camera.name
                if is_changed:
                    self._holdout ^= {camera.name}
                imgui.pop_id()
        imgui.end_child()
        imgui.end_group()

    def _draw_forecast(self, found: OpeningForecast | None, problem: str, ui: UiState, *, is_final: bool) -> None:
        imgui.spacing()
        push_bold(ui, ui.fonts.body_size)
        imgui.text("Forecast")
        pop_bold(ui)
        if problem:
            imgui.text_colored(imgui.ImVec4(*theme.ORANGE), Icon.WARNING)
            imgui.same_line()
            imgui.text(problem)
            return
        if found is None:
            text_wrapped_dim("estimating ...")
            ui.redraw_within(0.1)
            return
        for line in forecast_lines(found, is_final=is_final):
            text_wrapped_dim(line)
        if not is_final:
            ui.redraw_within(0.2)


def forecast_lines(found: OpeningForecast, *, is_final: bool) -> list[str]:
    """Text of the dialog about a forecast."""
    if found.total_s is None:
        time = "not known before the first clip has begun" if is_final else "measuring this machine ..."
    else:
        time = f"about {_time_text(found.total_s)}"
        if found.n_clips > 1:
            time += f", the first clip {_time_text(found.reference_s)}"
    memory = "" if found.memory_mb is None else f", {found.memory_mb / 1e3:.1f} GB of memory"
    free = "" if found.free_mb is None else f", {_bytes_text(found.free_mb)} are free"
    return [
        f"Training: {time}",
        f"From {format_count(found.n_pictures)} pictures of {found.size[0]} x {found.size[1]}{memory}",
        f"Disk: about {_bytes_text(found.disk_mb)}{free}",
    ]


def _time_text(seconds: float | None) -> str:
    if seconds is None:
        return "-"
    return f"{duration_text(seconds)} min" if seconds < 3600 else duration_text(seconds)


def _bytes_text(megabytes: float) -> str:
    return f"{megabytes / 1e3:,.1f} GB" if megabytes >= 1000 else f"{megabytes:,.0f} MB"


def _label(text: str) -> None:
    imgui.align_text_to_frame_padding()
    imgui.text(text)
    imgui.same_line(LABEL_WIDTH)


def _said(text: str) -> None:
    imgui.same_line()
    imgui.text_disabled(text)


def _whole_number(label: str, value: int, low: int, high: int) -> int:
    """A field for a number. While it is typed, what does not fit is drawn in."""
    imgui.set_next_item_width(FIELD_WIDTH)
    is_changed, typed = imgui.input_int(label, value, 0, 0)
    return min(max(typed, low), high) if is_changed else value
