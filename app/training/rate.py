"""Rate: how fast something advances, exponentially smoothed, and how long the rest takes."""

from __future__ import annotations

import math

TIME_CONSTANT_S = 5.0
"""Older speeds fade with this time constant, so that the estimate follows a change of phase within seconds."""


class SmoothedRate:
    """Smoothed units per second. The caller supplies the clock, so that tests need none."""

    def __init__(self, time_constant_s: float = TIME_CONSTANT_S) -> None:
        self._time_constant_s = time_constant_s
        self._last: tuple[float, float] | None = None
        self._is_paused = False
        self._units = 0.0
        self._seconds = 0.0

    def update(self, done: float, now_s: float) -> None:
        """Record how much is done at a time; going backwards starts over."""
        if self._last is None or done < self._last[0]:
            self._units = self._seconds = 0.0
        elif not self._is_paused and now_s > self._last[1]:
            dt_s = now_s - self._last[1]
            fade = math.exp(-dt_s / self._time_constant_s)
            self._units = self._units * fade + (done - self._last[0])
            self._seconds = self._seconds * fade + dt_s
        elif not self._is_paused:
            return
        self._is_paused = False
        self._last = (done, now_s)

    def pause(self) -> None:
        """Leave out the time until the next update."""
        self._is_paused = True

    @property
    def seconds(self) -> float:
        """How much time is behind the rate; faded time counts in part."""
        return self._seconds

    @property
    def per_s(self) -> float:
        """Units per second; 0 when unknown."""
        return self._units / self._seconds if self._seconds > 0 else 0.0

    def eta_s(self, left: float) -> float | None:
        """Seconds for the rest; None when unknown."""
        return left / self.per_s if self.per_s > 0 else None
