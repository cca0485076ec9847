"""Keys on the timeline as diamonds: drawn in a lane, and found under the pointer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from imgui_bundle import ImVec2

from ui.panels.state import Rect
from ui.panels.timeline.rows.stage import TimelineStage
from ui.style import theme

HALF, CHOSEN_HALF = 5.0, 6.5
MIN_KEY_DISTANCE = 3.0
"""Keys closer to each other than this are drawn as one."""
DRAG_FROM = 3.0
"""A press that moves less than this chooses a key and leaves it where it is."""
EASY = 2.0
"""By how much a diamond is easier to hit than it looks."""


def draw_diamonds(
    stage: TimelineStage, frames: Sequence[float], row: Rect, name: str, color: theme.Color, *, chosen: int | None
) -> None:
    """A diamond per key.

    Args:
        frames: When the keys are, rising.
        name: Of their rectangles, before the number.
        chosen: Number of the one that stands out; None without one.
    """
    y, x_before = (row.y0 + row.y1) / 2, -1e9
    for index in _in_sight(stage, frames):
        x, is_chosen = stage.scale.middle_of(frames[index]), index == chosen
        if x - x_before < MIN_KEY_DISTANCE and not is_chosen:
            continue
        x_before = x
        half = CHOSEN_HALF if is_chosen else HALF
        corners = ImVec2(x, y - half), ImVec2(x + half, y), ImVec2(x, y + half), ImVec2(x - half, y)
        stage.draw.add_quad_filled(*corners, theme.u32(theme.YELLOW if is_chosen else color))
        if is_chosen:
            stage.draw.add_quad(*corners, theme.u32(theme.TEXT), 1.5)
        stage.ui.mark_rect(f"{name}{index}", Rect(x - half, y - half, x + half, y + half))


def nearest_diamond(stage: TimelineStage, frames: Sequence[float], x: float) -> int | None:
    """Number of the key at a place of the screen, if one is near enough."""
    away = [(abs(stage.scale.middle_of(frames[index]) - x), index) for index in _in_sight(stage, frames)]
    distance, nearest = min(away, default=(np.inf, -1))
    return nearest if distance <= CHOSEN_HALF + EASY else None


def _in_sight(stage: TimelineStage, frames: Sequence[float]) -> range:
    """Numbers of the keys within the shown part."""
    shown = stage.scale.shown
    first, stop = np.searchsorted(np.asarray(frames), [shown.start - 0.5, shown.stop + 0.5])
    return range(int(first), int(stop))
