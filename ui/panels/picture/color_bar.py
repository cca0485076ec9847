"""A colour bar over a picture: which colours mean which values, in which unit, and the value under the pointer."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.playback.modes.color_maps import COLOR_MAPS, N_COLORS
from ui.panels.state import Rect
from ui.style import theme

COLOR_BAR_SIZE = (236.0, 54.0)
"""Width and height of the plate with bar and numbers, units."""
PADDING = 10.0
BAR_HEIGHT = 12.0
N_PIECES = 32
"""Pieces that the bar is drawn in; colours run evenly inside each."""


def draw_color_bar(
    draw: imgui.ImDrawList,
    rect: Rect,
    map_name: str,
    low: float,
    high: float,
    unit: str,
    value_under_pointer: float | None = None,
) -> None:
    """Draw a bar with its numbers on a dark plate.

    Args:
        rect: The plate; COLOR_BAR_SIZE is a good size of it.
        map_name: One of app.playback.modes.color_maps.COLOR_MAPS.
        low, high: Values at the left and the right end.
        unit: Written after the numbers; empty for a plain number.
        value_under_pointer: Marked on the bar and written between its ends; None where there is none.
    """
    draw.add_rect_filled(rect.low, rect.high, theme.u32(theme.faded(theme.VOID, 0.82)), 4)
    x0, x1 = rect.x0 + PADDING, rect.x1 - PADDING
    y0 = rect.y0 + PADDING
    y1 = y0 + BAR_HEIGHT
    table = COLOR_MAPS[map_name]
    stops = [theme.u32(_color(table[round(i * (N_COLORS - 1) / N_PIECES)])) for i in range(N_PIECES + 1)]
    width = (x1 - x0) / N_PIECES
    for piece in range(N_PIECES):
        left, right = stops[piece], stops[piece + 1]
        corner = ImVec2(x0 + piece * width, y0)
        draw.add_rect_filled_multi_color(corner, ImVec2(x0 + (piece + 1) * width, y1), left, right, right, left)
    draw.add_rect(ImVec2(x0, y0), ImVec2(x1, y1), theme.u32(theme.faded(theme.ON_PICTURE.playhead, 0.35)))
    text_y = y1 + 5
    low_text, high_text = bar_number(low, low, high), bar_number(high, low, high)
    high_text = f"{high_text} {unit}".rstrip()
    dim = theme.u32(theme.faded(theme.ON_PICTURE.playhead, 0.72))
    draw.add_text(ImVec2(x0, text_y), dim, low_text)
    draw.add_text(ImVec2(x1 - imgui.calc_text_size(high_text).x, text_y), dim, high_text)
    if value_under_pointer is None:
        return
    white = theme.u32(theme.ON_PICTURE.playhead)
    share = min(max((value_under_pointer - low) / (high - low), 0.0), 1.0)
    x = x0 + share * (x1 - x0)
    draw.add_triangle_filled(ImVec2(x - 5, y0 - 6), ImVec2(x + 5, y0 - 6), ImVec2(x, y0 + 1), white)
    draw.add_line_v(x, y0, y1, white, 1)
    text = bar_number(value_under_pointer, low, high)
    half = imgui.calc_text_size(text).x / 2
    first = x0 + imgui.calc_text_size(low_text).x + 8 + half
    last = x1 - imgui.calc_text_size(high_text).x - 8 - half
    draw.add_text(ImVec2(min(max(x, first), max(first, last)) - half, text_y), white, text)


def bar_number(value: float, low: float, high: float) -> str:
    """A value with as many digits as separate about a thousand steps of the range, and two where it is near zero, in
    the fewest characters."""
    span = max(abs(low), abs(high))
    least = 9.5 if abs(value) >= span / 1000.0 else 0.0
    decimals = next((n for n in range(6) if span * 10**n >= 100.0 and abs(value) * 10**n >= least), 6)
    text = f"{value:.{decimals}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text in ("-0", "") else text


def _color(row: object) -> theme.Color:
    r, g, b = (int(v) / 255.0 for v in row)  # type: ignore[attr-defined] - a row of a table of numbers
    return r, g, b, 1.0
