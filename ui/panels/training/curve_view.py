"""CurveView: which curves are shown and which part of them: the user's choice in the plots of the training panel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

MAX_CHOSEN = 6
"""Clips at once: as many as there are hues that stay apart."""
MIN_SPAN = 4.0
"""Steps; nearer than that there is nothing to see."""


@dataclass
class CurveView:
    """State of the plots.

    Attributes:
        chosen: Clips whose curves are shown; none: the one that trains, or the one that is looked at.
        is_log: Whether the loss is drawn on a logarithmic scale.
        span: First and last step shown; None for all of them.
        pointer_step: Step under the pointer, in whichever plot it is; None elsewhere.
    """

    chosen: list[int] = field(default_factory=list)
    is_log: bool = False
    span: tuple[float, float] | None = None
    pointer_step: float | None = None

    def toggle(self, clip_index: int) -> None:
        """Show the curves of a clip, or no longer; the one chosen first gives way to one too many."""
        if clip_index in self.chosen:
            self.chosen.remove(clip_index)
        else:
            self.chosen = [*self.chosen, clip_index][-MAX_CHOSEN:]

    def shown(self, default: int | None, n_clips: int) -> list[int]:
        """Clips to show. default: Where none was chosen."""
        chosen = [index for index in self.chosen if index < n_clips]
        return chosen or ([] if default is None else [default])

    def limits(self, last: float) -> tuple[float, float]:
        """First and last step on the axis. last: The last one there is."""
        return (0.0, last) if self.span is None else self.span

    def zoom(self, ticks: float, at: float, last: float) -> None:
        """Show a smaller part around a step, or with negative ticks a larger one."""
        low, high = self.limits(last)
        factor = 0.8**ticks
        self._set(at - (at - low) * factor, at + (high - at) * factor, last)

    def pan(self, steps: float, last: float) -> None:
        """Show a later part."""
        low, high = self.limits(last)
        if self.span is not None:
            steps = min(max(steps, -low), last - high)
            self._set(low + steps, high + steps, last)

    def show_all(self) -> None:
        """Show every step again."""
        self.span = None

    def _set(self, low: float, high: float, last: float) -> None:
        low, high = max(low, 0.0), min(high, last)
        if high - low < MIN_SPAN:
            middle = min(max((low + high) / 2, MIN_SPAN / 2), max(last - MIN_SPAN / 2, MIN_SPAN / 2))
            low, high = middle - MIN_SPAN / 2, middle + MIN_SPAN / 2
        self.span = None if low <= 0.0 and high >= last else (low, high)


def value_range(
    curves: Sequence[tuple[np.ndarray, np.ndarray]], limits: tuple[float, float], *, is_log: bool
) -> tuple[float, float] | None:
    """Lowest and highest value to draw, with room above and below; None where no value lies in the limits.

    Args:
        curves: Steps and values of each, float64 [n].
        limits: First and last step that is shown.
        is_log: On a logarithmic scale, where only positive values count.
    """
    seen = []
    for steps, values in curves:
        is_seen = (steps >= limits[0]) & (steps <= limits[1]) & ((values > 0) | (not is_log))
        seen.append(values[is_seen])
    found = np.concatenate(seen) if seen else np.zeros(0)
    if not len(found):
        return None
    low, high = float(found.min()), float(found.max())
    if is_log:
        return low / 1.15, high * 1.15
    margin = max((high - low) * 0.1, abs(high) * 0.01, 1e-6)
    return low - margin, high + margin


def value_at(steps: np.ndarray, values: np.ndarray, step: float) -> tuple[int, float] | None:
    """The point of a curve nearest to a step; None of an empty curve. steps rise. float64 [n]"""
    if not len(steps):
        return None
    after = int(np.clip(np.searchsorted(steps, step), 1, max(len(steps) - 1, 1)))
    nearest = min((after - 1, min(after, len(steps) - 1)), key=lambda index: abs(steps[index] - step))
    return int(steps[nearest]), float(values[nearest])
