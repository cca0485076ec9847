"""The log panel: what the program and the training said, filtered by text, level and source; it follows the end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from imgui_bundle import ImVec2, ImVec4, imgui

from app.background.log_reader import LogLine
from app.session.session_view import SessionView
from ui.panels.state import Dispatch, UiState
from ui.style import theme
from ui.style.theme import Icon

LEVEL_CHOICES = (("every level", ""), ("warnings", "WARNING"), ("errors", "ERROR"))
SOURCE_CHOICES = (("every source", "all"), ("program", "program"), ("training", "training"))
_RANK = {"DEBUG": 0, "INFO": 1, "WARNING": 2, "ERROR": 3, "CRITICAL": 4}
_MARKS = {"WARNING": Icon.WARNING, "ERROR": Icon.ERROR, "CRITICAL": Icon.ERROR}
REFRESH_S = 0.5
"""While something trains; it writes its log whenever it likes."""


@dataclass
class LogFilter:
    """Which lines are shown.

    Attributes:
        text: Has to occur in the line, whatever its case; empty for every line.
        level: Least level; empty for every one.
        source: "all", "program" or "training".
    """

    text: str = ""
    level: str = ""
    source: str = "all"

    def keeps(self, line: LogLine) -> bool:
        """Whether a line is shown."""
        if self.level and _RANK.get(line.level, 1) < _RANK[self.level]:
            return False
        if self.source != "all" and (line.source == "program") != (self.source == "program"):
            return False
        return self.text.casefold() in f"{line.source} {line.text}".casefold()


def line_text(line: LogLine) -> str:
    """A line as it is shown and copied."""
    return f"{line.time[11:19]}  {line.source}  {line.text}"


class LogPanel:
    """Owns the filter, and what it let through of the lines seen last."""

    def __init__(self) -> None:
        self.filter = LogFilter()
        self.is_following = True
        self._shown: list[LogLine] = []
        self._shown_of: tuple[object, ...] = ()
        self._was_at_end = True

    def draw(self, session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        """Filter, buttons, lines."""
        shown = self._filtered(session.log_lines(ui.log_clip))
        self._draw_tools(shown, ui)
        if session.training.is_anywhere:
            ui.redraw_within(REFRESH_S)
        flags = imgui.WindowFlags_.horizontal_scrollbar
        imgui.push_style_color(imgui.Col_.child_bg, ImVec4(*theme.BACKDROP))
        is_visible = imgui.begin_child("lines", ImVec2(0, 0), 0, flags)
        imgui.pop_style_color()
        if is_visible:
            self._draw_lines(shown)
        imgui.end_child()
        ui.mark("log.lines")

    def _filtered(self, lines: Sequence[LogLine]) -> list[LogLine]:
        key = (id(lines), len(lines), self.filter.text, self.filter.level, self.filter.source)
        if key != self._shown_of:
            self._shown_of = key
            self._shown = [line for line in lines if self.filter.keeps(line)]
        return self._shown

    def _draw_tools(self, shown: Sequence[LogLine], ui: UiState) -> None:
        imgui.set_next_item_width(min(max(imgui.get_content_region_avail().x * 0.3, 90.0), 260.0))
        is_edited, text = imgui.input_text_with_hint("##filter", "Filter", self.filter.text)
        ui.mark("log.filter")
        if is_edited:
            self.filter.text = text
        imgui.same_line()
        self.filter.level = _combo("level", LEVEL_CHOICES, self.filter.level, ui)
        imgui.same_line()
        self.filter.source = _combo("source", SOURCE_CHOICES, self.filter.source, ui)
        imgui.same_line()
        if imgui.button(f"{Icon.COPY}##copy"):
            imgui.set_clipboard_text("\n".join(line_text(line) for line in shown))
        ui.mark("log.copy")
        imgui.set_item_tooltip("Copy the shown lines")
        imgui.same_line()
        _, self.is_following = imgui.checkbox("Follow", self.is_following)
        ui.mark("log.follow")
        imgui.set_item_tooltip("Stay at the newest line; scroll up to pause")
        imgui.same_line()
        if ui.log_clip is not None:
            if imgui.button(f"Clip {ui.log_clip}  {Icon.CLOSE}##log clip"):
                ui.log_clip = None
            ui.mark("log.clip")
            imgui.set_item_tooltip("Only this clip's log is shown; click for that of the clip at the playhead")
            imgui.same_line()
        imgui.text_disabled("1 line" if len(shown) == 1 else f"{len(shown):,} lines")

    def _draw_lines(self, shown: Sequence[LogLine]) -> None:
        if not shown:
            imgui.text_disabled("No lines match." if self.filter != LogFilter() else "The log is empty.")
            return
        clipper = imgui.ListClipper()
        clipper.begin(len(shown))
        while clipper.step():
            for index in range(clipper.display_start, clipper.display_end):
                line = shown[index]
                mark = _MARKS.get(line.level)
                text = line_text(line)
                imgui.text_colored(ImVec4(*_color(line.level)), f"{mark} {text}" if mark else text)
        clipper.end()
        if imgui.is_window_hovered() and imgui.get_io().mouse_wheel > 0:
            self.is_following = False
        elif self.is_following:
            imgui.set_scroll_here_y(1.0)


def _combo(name: str, choices: Sequence[tuple[str, str]], chosen: str, ui: UiState) -> str:
    words = next(word for word, value in choices if value == chosen)
    imgui.set_next_item_width(124.0)
    if imgui.begin_combo(f"##{name}", words):
        for word, value in choices:
            if imgui.selectable(word, value == chosen)[0]:
                chosen = value
            ui.mark(f"log.{name}.{word}")
        imgui.end_combo()
    ui.mark(f"log.{name}")
    return chosen


def _color(level: str) -> theme.Color:
    """Of a line; its sign says the same."""
    by_level = {
        "WARNING": theme.ORANGE,
        "ERROR": theme.VERMILLION,
        "CRITICAL": theme.VERMILLION,
        "DEBUG": theme.TEXT_DIM,
    }
    return by_level.get(level, theme.TEXT)
