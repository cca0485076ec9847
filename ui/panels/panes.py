"""Where views, and the pictures in each of them, lie in the viewport."""

from __future__ import annotations

from dataclasses import dataclass

from ui.panels.state import Rect


@dataclass(frozen=True)
class Panes:
    """Where the rendered and the captured picture lie."""

    rendered: Rect
    captured: Rect | None


def fit(area: Rect, width: float, height: float) -> Rect:
    """The largest rectangle of this aspect, centred in the area."""
    scale = min(area.width / max(width, 1.0), area.height / max(height, 1.0))
    x, y = area.center
    return Rect(x - width * scale / 2, y - height * scale / 2, x + width * scale / 2, y + height * scale / 2)


def arrange(area: Rect, image_size: tuple[int, int] | None, compare: str) -> Panes:
    """Lay out the panes; without a capture camera the whole area is the rendered picture."""
    if image_size is None:
        return Panes(area, None)
    if compare == "side":
        middle = area.center[0]
        left = fit(Rect(area.x0, area.y0, middle - 2, area.y1), *image_size)
        right = fit(Rect(middle + 2, area.y0, area.x1, area.y1), *image_size)
        return Panes(rendered=right, captured=left)
    pane = fit(area, *image_size)
    return Panes(pane, pane if compare == "wipe" else None)


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
