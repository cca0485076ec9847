"""StillRows: rows that stand still, each for as long as nothing but a little light changes on it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from engine.export.player.still_part import shared_rows
from engine.export.splats import Splats

LIGHT = 1.0 / 255.0
"""Colours of a row over time are this near to the one that it gets. Everything else is the same bit for bit."""


@dataclass(frozen=True, slots=True)
class LastingRows:
    """Rows and how long they last. first, end: frames of the file. [N] int64"""

    splats: Splats
    first: np.ndarray
    end: int


class StillRows:
    """The still rows of stretches, which come one after another."""

    def __init__(self) -> None:
        self._splats: Splats | None = None
        self._first = np.zeros(0, np.int64)
        self._lowest = self._highest = np.zeros((0, 3), np.float32)

    def add(self, splats: Splats, first_frame: int) -> LastingRows | None:
        """Add a stretch that begins at a frame. Returns the rows that have ended there."""
        found, is_over = np.full(len(splats), -1, np.int64), np.ones(len(self._first), bool)
        if self._splats is not None:
            found, is_over = shared_rows(self._splats, splats)
        lowest, highest = splats.colors.copy(), splats.colors.copy()
        rows = np.flatnonzero(found >= 0)
        lower = np.minimum(self._lowest[found[rows]], splats.colors[rows])
        higher = np.maximum(self._highest[found[rows]], splats.colors[rows])
        is_near = (higher - lower <= 2.0 * LIGHT).all(1)
        is_over[found[rows[~is_near]]] = True
        found[rows[~is_near]] = -1
        rows = rows[is_near]
        lowest[rows], highest[rows] = lower[is_near], higher[is_near]
        ended = self._rows(np.flatnonzero(is_over), first_frame)
        first = np.full(len(splats), first_frame)
        first[rows] = self._first[found[rows]]
        self._splats, self._first, self._lowest, self._highest = splats, first, lowest, highest
        return ended

    def close(self, end: int) -> LastingRows | None:
        """End all rows."""
        ended = self._rows(np.arange(len(self._first)), end)
        self.__init__()
        return ended

    def _rows(self, rows: np.ndarray, end: int) -> LastingRows | None:
        if self._splats is None or not len(rows):
            return None
        colors = 0.5 * (self._lowest[rows] + self._highest[rows])
        return LastingRows(replace(self._splats[rows], colors=colors), self._first[rows], end)
