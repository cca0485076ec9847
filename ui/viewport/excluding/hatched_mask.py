"""Diagonal lines over the painted part, as segments in shares of a picture. Arithmetic only."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from engine.capture.exclusions import Stroke
from engine.capture.pixels.excluded_pixels import painted_pixels

COLUMNS = 192
"""The mask is looked at on a grid this wide."""
PERIOD = 4
"""Cells from one line to the next."""


def hatch_lines(strokes: Sequence[Sequence[Stroke]], aspect: float) -> np.ndarray:
    """Lines over painted masks.

    Args:
        strokes: Of each mask.
        aspect: Width of the picture through its height.
    Returns:
        x0, y0, x1, y1 of each line, shares of width and height. [N, 4] float64
    """
    height = max(round(COLUMNS / max(aspect, 1e-3)), 1)
    is_painted = np.zeros((height, COLUMNS), bool)
    for one in strokes:
        is_painted |= painted_pixels(one, COLUMNS, height)
    lines = []
    for diagonal in range(0, COLUMNS + height, PERIOD):  # cells with x + y = diagonal
        xs = np.arange(max(diagonal - height + 1, 0), min(diagonal, COLUMNS - 1) + 1)
        found = is_painted[diagonal - xs, xs]
        edges = np.flatnonzero(np.diff(np.concatenate([[False], found, [False]]).astype(np.int8)))
        for begin, end in edges.reshape(-1, 2):
            x0, x1 = xs[0] + begin, xs[0] + end
            lines.append((x0, diagonal + 1 - x0, x1, diagonal + 1 - x1))
    return np.array(lines, np.float64).reshape(-1, 4) / (COLUMNS, height, COLUMNS, height)
