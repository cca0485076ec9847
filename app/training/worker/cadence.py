"""Cadence: when something that costs time is due again."""

from __future__ import annotations


class Cadence:
    """When something that costs time is due again: not more often than `every_s`, nor than its share of time allows.

    Args:
        every_s: Shortest time from the start of one to the start of the next, seconds.
        max_share: Share of all time that it may take.
    """

    def __init__(self, every_s: float, max_share: float = 1.0) -> None:
        self._every_s, self._max_share = every_s, max_share
        self._next_s: float | None = None

    def is_due(self, now_s: float) -> bool:
        """Whether it is time; the first time is one interval after the first question."""
        if self._next_s is None:
            self._next_s = now_s + self._every_s
        return now_s >= self._next_s

    def done(self, started_s: float, now_s: float) -> None:
        """Record when it was done, from and until."""
        self._next_s = started_s + max(self._every_s, (now_s - started_s) / self._max_share)
