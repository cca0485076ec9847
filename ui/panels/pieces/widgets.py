"""Small drawing pieces that several panels share."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from imgui_bundle import ImVec2, ImVec4, imgui

from app.status import JobStatus
from ui.panels.state import Rect, UiState
from ui.style import theme
from ui.style.colors import Color

JOB_REFRESH_S = 0.25
"""While a job runs, the window is drawn so often."""
LEAST_WITH_ARROW = 92.0
"""Boxes narrower than this do without an arrow, units."""


def text_right(text: str, color: Color | None = None) -> None:
    """Text at the right end of the current line, pushed right rather than overlapping other things."""
    imgui.same_line()
    free = imgui.get_content_region_avail().x - imgui.calc_text_size(text).x
    imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(free, 0.0))
    imgui.text_colored(ImVec4(*(theme.TEXT_DIM if color is None else color)), text)


def text_wrapped_dim(text: str) -> None:
    """Secondary text, wrapped at the panel's edge."""
    imgui.push_text_wrap_pos(0.0)
    imgui.text_colored(ImVec4(*theme.TEXT_DIM), text)
    imgui.pop_text_wrap_pos()


def text_wrapped(text: str) -> None:
    """Text, wrapped at the panel's edge, with nothing in it that formats."""
    imgui.push_text_wrap_pos(0.0)
    imgui.text(text)
    imgui.pop_text_wrap_pos()


def draw_job_bar(job: JobStatus | None, ui: UiState, width: float, height: float) -> None:
    """How far a job is; a bar that moves to and fro while that is unknown. The window is drawn again soon."""
    share = 0.0 if job is None else min(max(job.done, 0.0), 1.0)
    imgui.progress_bar(share if share > 0.0 else -imgui.get_time(), ImVec2(width, height), "")
    ui.redraw_within(JOB_REFRESH_S)


def text_warning(text: str) -> None:
    """A warning, wrapped at the panel's edge."""
    imgui.push_text_wrap_pos(0.0)
    imgui.text_colored(ImVec4(*theme.ORANGE), f"{theme.Icon.WARNING}  {text}")
    imgui.pop_text_wrap_pos()


def primary_button(label: str, size: ImVec2, ui: UiState) -> bool:
    """The one button of a panel that the user most likely wants."""
    imgui.push_style_color(imgui.Col_.button, ImVec4(*theme.SKY))
    imgui.push_style_color(imgui.Col_.button_hovered, ImVec4(*theme.SKY_LIGHT))
    imgui.push_style_color(imgui.Col_.button_active, ImVec4(*theme.SKY_DARK))
    imgui.push_style_color(imgui.Col_.text, ImVec4(*theme.TEXT_ON_ACCENT))
    push_bold(ui, ui.fonts.body_size)
    is_clicked = imgui.button(label, size)
    pop_bold(ui)
    imgui.pop_style_color(4)
    return is_clicked


def push_bold(ui: UiState, size: float) -> None:
    """Bold face at a size; the built-in face keeps its own look."""
    imgui.push_font(ui.fonts.bold, size)


def pop_bold(ui: UiState) -> None:
    """Undo push_bold."""
    imgui.pop_font()


def chip(
    draw: imgui.ImDrawList, x: float, y: float, text: str, *, color: Color | None = None, is_right: bool = False
) -> float:
    """Text on a dark plate over a picture; returns its right edge.

    Args:
        color: One of theme.ON_PICTURE, whose text it is when None.
        is_right: x is the right edge.
    """
    width = imgui.calc_text_size(text).x + 18
    left = x - width if is_right else x
    plate = Rect(left, y, left + width, y + 24)
    draw.add_rect_filled(plate.low, plate.high, theme.u32(theme.faded(theme.VOID, 0.78)), 4)
    draw.add_text(ImVec2(left + 9, y + 4), theme.u32(theme.ON_PICTURE.text if color is None else color), text)
    return plate.x1


def elided(text: str, width: float) -> str:
    """The text, or as much of its beginning as fits into a width, with three dots."""
    return _longest_fit(text, width, lambda n: f"{text[:n].rstrip()}...")


def elided_path(path: str, width: float) -> str:
    """The path, or as much of its end as fits into a width: the last folders tell most."""
    return _longest_fit(path, width, lambda n: f"...{path[len(path) - n :]}")


def _longest_fit(text: str, width: float, cut: Callable[[int], str]) -> str:
    """The text if it fits, otherwise its longest cut that does; `cut` leaves that many characters."""
    if imgui.calc_text_size(text).x <= width:
        return text
    fits, too_long = 0, len(text)
    while too_long - fits > 1:
        middle = (fits + too_long) // 2
        if imgui.calc_text_size(cut(middle)).x <= width:
            fits = middle
        else:
            too_long = middle
    return cut(fits)


MOST_BOX = 230.0
"""Words that need a wider box end in dots, units."""


def box_width(words: str, *, has_arrow: bool) -> float:
    """How wide a box of choices has to be for its words, units. has_arrow: Also where the words are short."""
    bare = imgui.calc_text_size(words).x + 2 * imgui.get_style().frame_padding.x + 2
    if not has_arrow and bare < LEAST_WITH_ARROW:
        return bare
    return min(max(bare + imgui.get_frame_height(), LEAST_WITH_ARROW), MOST_BOX)


def box_words(words: str, width: float) -> str:
    """The words of a box of choices as far as they fit into it."""
    arrow = imgui.get_frame_height() if width >= LEAST_WITH_ARROW else 0.0
    return elided(words, width - arrow - 2 * imgui.get_style().frame_padding.x)


def box_flags(width: float) -> int:
    """Of a box of choices in a row of them: all choices at once, and no arrow where its word needs the room."""
    flags = int(imgui.ComboFlags_.height_largest)
    return flags if width >= LEAST_WITH_ARROW else flags | int(imgui.ComboFlags_.no_arrow_button)


ROW_GAP = 4.0
"""Between buttons that fill a row, units."""


def row_widths(labels: Sequence[str]) -> list[float]:
    """Of buttons that fill a row, units: each as wide as its words need, and an equal part of the rest."""
    words = [imgui.calc_text_size(label).x for label in labels]
    rest = imgui.get_content_region_avail().x - ROW_GAP * (len(labels) - 1) - sum(words)
    return [width + rest / len(labels) for width in words]


def segment(label: str, is_on: bool, width: float = 0.0, height: float = 0.0) -> bool:
    """One of several buttons side by side, of which some are on. width, height: Units; those of its words when 0."""
    if is_on:
        imgui.push_style_color(imgui.Col_.button, ImVec4(*theme.faded(theme.SKY, 0.9)))
        imgui.push_style_color(imgui.Col_.button_hovered, ImVec4(*theme.SKY))
        imgui.push_style_color(imgui.Col_.text, ImVec4(*theme.TEXT_ON_ACCENT))
    is_clicked = imgui.button(f"{label}##segment", ImVec2(width, height))
    if is_on:
        imgui.pop_style_color(3)
    return is_clicked
