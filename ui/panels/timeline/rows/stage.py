"""Stage: where the rows of the timeline are drawn, handed to each of them. And what several of them draw alike."""

from __future__ import annotations

from dataclasses import dataclass

from imgui_bundle import ImVec2, imgui

from ui.panels.state import Rect, UiState
from ui.panels.timeline.time_range import TimeScale
from ui.style import theme

SMALL_TEXT = 13.0
"""Size of the letters in rows that are too low for the usual ones, units."""


@dataclass(frozen=True)
class TimelineStage:
    """One frame's drawing of the timeline.

    Attributes:
        track: Ruler and lanes, without the names at the left.
        rows: Where each row lies; one that has given way is missing.
        pointer: Where the pointer is, if it is over the track and nothing lies over that; None else.
    """

    draw: imgui.ImDrawList
    scale: TimeScale
    track: Rect
    rows: dict[str, Rect]
    pointer: tuple[float, float] | None
    ui: UiState

    def is_pointed_at(self, name: str) -> bool:
        """Whether the pointer is over a row."""
        row = self.rows.get(name)
        return row is not None and self.pointer is not None and row.y0 <= self.pointer[1] < row.y1


def hatch(draw: imgui.ImDrawList, rect: Rect, color: theme.Color, spacing: float, *, is_crossed: bool = False) -> None:
    """Diagonal lines, one way or both; clipped to the rectangle."""
    if rect.width < 1:
        return
    packed = theme.u32(color)
    draw.push_clip_rect(rect.low, rect.high, True)
    x = rect.x0 - rect.height
    while x < rect.x1:
        draw.add_line(ImVec2(x, rect.y1), ImVec2(x + rect.height, rect.y0), packed, 1.5)
        if is_crossed:
            draw.add_line(ImVec2(x, rect.y0), ImVec2(x + rect.height, rect.y1), packed, 1.5)
        x += spacing
    draw.pop_clip_rect()


def small_text(draw: imgui.ImDrawList, x: float, y: float, text: str, color: theme.Color) -> None:
    """Text in small letters."""
    draw.add_text(imgui.get_font(), SMALL_TEXT, ImVec2(x, y), theme.u32(color), text)


def small_width(text: str) -> float:
    """How wide text in small letters is."""
    return imgui.calc_text_size(text).x * SMALL_TEXT / imgui.get_font_size()
