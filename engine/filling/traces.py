"""Traces of something that moves in what stands still.

A place through which a person walks is empty: whatever stands still there is a trace of the time when the person stood
still, which training took for a part of the room. Traces have the colours of what left them, and
lie above the ground on which it stands.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

CELL_SPACINGS = 2.0
"""Edge of the cells in which things are noted to have been, in spacings of the static anchors."""
MIN_OPACITY = 0.3
"""Fainter Gaussians of something that moves do not say where it is."""
MIN_NOTED = 3
"""So many Gaussians, over all frames, have to have been in a cell."""
GROUND_SHARE = 0.05
"""Share of the thing's height above its lowest point that may be ground."""
COLOR_REACH = 0.25
"""Largest difference of a channel between a trace and what left it."""


@dataclass(slots=True)
class Swept:
    """Where something was, cell by cell.

    Args:
        cell: Edge of a cell, scene units.
        up: Away from the ground. [3]
    """

    cell: float
    up: np.ndarray
    _counts: dict[tuple[int, int, int], int] = field(default_factory=dict)
    _colors: dict[tuple[int, int, int], np.ndarray] = field(default_factory=dict)
    _low: float = np.inf
    _high: float = -np.inf

    def add(self, means: np.ndarray, opacities: np.ndarray, colors: np.ndarray) -> None:
        """Note where it is at a moment. means: [N, 3]; opacities: [N]; colors: [N, 3]"""
        is_clear = opacities > MIN_OPACITY
        means, colors = means[is_clear], colors[is_clear]
        if not len(means):
            return
        heights = means @ self.up
        low, high = np.percentile(heights, (1, 99))
        self._low, self._high = min(self._low, float(low)), max(self._high, float(high))
        cells, row, counts = np.unique(self._cells(means), axis=0, return_inverse=True, return_counts=True)
        sums = np.zeros((len(cells), 3))
        np.add.at(sums, row.reshape(-1), colors)
        for cell, count, color in zip(map(tuple, cells.tolist()), counts.tolist(), sums, strict=True):
            self._counts[cell] = self._counts.get(cell, 0) + count
            self._colors[cell] = self._colors.get(cell, 0.0) + color

    def is_trace(self, means: np.ndarray, colors: np.ndarray) -> np.ndarray:
        """Which of some still Gaussians are traces of it. means: [N, 3]; colors: [N, 3]; [N] bool"""
        found = np.zeros(len(means), bool)
        if not self._counts:
            return found
        ground = self._low + GROUND_SHARE * (self._high - self._low)
        heights = np.where(np.isfinite(means).all(1), means @ self.up, -np.inf)
        rows = np.flatnonzero((heights > ground) & (heights <= self._high))
        for row, cell in zip(rows, map(tuple, self._cells(means[rows]).tolist()), strict=True):
            count = self._counts.get(cell, 0)
            if count >= MIN_NOTED:
                found[row] = np.abs(self._colors[cell] / count - colors[row]).max() <= COLOR_REACH
        return found

    def _cells(self, means: np.ndarray) -> np.ndarray:
        return np.floor(means / self.cell).astype(np.int64)
