"""How large a picture the CPU rasterizer is asked for: as large as time allows while the view or the frame changes,
then full."""

from __future__ import annotations

import math

import numpy as np

MAX_PICTURE_WIDTH = 960
"""The CPU rasterizer is not asked for more than this; the picture is stretched."""
MOVING_SHARES = (0.25, 1.0)
"""Smallest and largest share of the full size at which a picture is made while the view moves."""
MOVING_MS = 18.0
"""A picture while the view moves should take about this long; its size follows from the last one's time."""
SLOW, QUICK = 1.4, 0.5
"""The size changes when a picture took more or less than these shares of MOVING_MS: one that changed with every picture
would flicker, and pictures made ahead while playing would be of another size than those asked for."""
HURRY_S = 0.25
"""The frame counts as changing for this long after it did."""


def picture_size(width: int, height: int, share: float) -> tuple[int, int]:
    """Width and height of a share of a view, px."""
    return max(round(width * share), 16), max(round(height * share), 16)


def moving_share(drawn_share: float, took_ms: float) -> float:
    """Share of the full size at which a picture takes about MOVING_MS, given what another one took.

    In eighths, so that the size does not change with every picture.
    """
    share = drawn_share * math.sqrt(MOVING_MS / max(took_ms, 1e-3))
    return float(np.clip(math.floor(share * 8) / 8, *MOVING_SHARES))


class MovingSize:
    """Follows how long pictures take, and whether they have to come quickly.

    Attributes:
        share: Of the full width and height, for as long as they do.
    """

    def __init__(self) -> None:
        self.share = MOVING_SHARES[1]
        self._frame_index: int | None = None
        self._changed_s = -1e9

    def note_picture(self, drawn_share: float, took_ms: float) -> None:
        """A picture was made.

        Args:
            drawn_share: Its share of the full width.
        """
        at_this_size_ms = took_ms * (self.share / max(drawn_share, 1e-3)) ** 2
        if not QUICK * MOVING_MS <= at_this_size_ms <= SLOW * MOVING_MS:
            self.share = moving_share(drawn_share, took_ms)

    def is_hurried(self, frame_index: int, now_s: float, *, is_playing: bool, is_loaded_first: bool = False) -> bool:
        """Is another frame looked at than a moment ago, and not loaded before it is shown? Asked for every picture.

        Args:
            now_s: Seconds of a clock that never goes back.
            is_loaded_first: See Course.
        """
        if frame_index != self._frame_index:
            is_first, self._frame_index = self._frame_index is None, frame_index
            self._changed_s = -1e9 if is_first else now_s
        return not is_loaded_first and (is_playing or now_s - self._changed_s < HURRY_S)
