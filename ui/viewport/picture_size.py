"""How large a picture the CPU rasterizer is asked for: as large as time allows while the view moves, then full."""

from __future__ import annotations

import math

import numpy as np

MAX_PICTURE_WIDTH = 960
"""The CPU rasterizer is not asked for more than this; the picture is stretched."""
MOVING_SHARES = (0.25, 1.0)
"""Smallest and largest share of the full size at which a picture is made while the view moves."""
MOVING_MS = 25.0
"""A picture while the view moves should take about this long; its size follows from the last one's time."""


def picture_size(width: int, height: int, share: float) -> tuple[int, int]:
    """Width and height of a share of a view, px."""
    return max(round(width * share), 16), max(round(height * share), 16)


def moving_share(drawn_share: float, took_ms: float) -> float:
    """Share of the full size at which a picture takes about MOVING_MS, given what another one took.

    In eighths, so that the size does not change with every picture.
    """
    share = drawn_share * math.sqrt(MOVING_MS / max(took_ms, 1e-3))
    return float(np.clip(math.floor(share * 8) / 8, *MOVING_SHARES))
