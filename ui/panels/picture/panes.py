"""Where views, and the pictures in each of them, lie in the viewport."""

from __future__ import annotations

from dataclasses import dataclass

from ui.panels.state import Rect


@dataclass(frozen=True)
class Panes:
    """Where the rendered picture lies, and the one that it is compared with: captured, or the frame in another mode."""

    rendered: Rect
    captured: Rect | None


def fit(area: Rect, width: float, height: float) -> Rect:
    """The largest rectangle of this aspect, centred in the area."""
    scale = min(area.width / max(width, 1.0), area.height / max(height, 1.0))
    x, y = area.center
    return Rect(x - width * scale / 2, y - height * scale / 2, x + width * scale / 2, y + height * scale / 2)


def arrange(area: Rect, image_size: tuple[int, int] | None, compare: str) -> Panes:
    """Lay out the panes. image_size: Of the capture camera; pictures of a free view fill all the room there is."""
    if compare == "side":
        middle = area.center[0]
        left, right = Rect(area.x0, area.y0, middle - 2, area.y1), Rect(middle + 2, area.y0, area.x1, area.y1)
        if image_size is not None:
            left, right = fit(left, *image_size), fit(right, *image_size)
        return Panes(rendered=right, captured=left)
    pane = area if image_size is None else fit(area, *image_size)
    return Panes(pane, None if compare == "off" else pane)


VIEW_GAP = 3.0
"""Between views side by side."""


def view_areas(area: Rect, n: int) -> list[Rect]:
    """One, two or four parts of an area: side by side, or in two rows."""
    if n == 1:
        return [area]
    x, y = area.center
    half = VIEW_GAP / 2
    columns = ((area.x0, x - half), (x + half, area.x1))
    rows = ((area.y0, area.y1),) if n == 2 else ((area.y0, y - half), (y + half, area.y1))
    return [Rect(x0, y0, x1, y1) for y0, y1 in rows for x0, x1 in columns]
