"""How far a calibration is: the shares of its stages put together, told by any thread and never going back."""

from __future__ import annotations

import threading
from collections.abc import Callable

from engine.progress import Progress, ReportProgress

STAGES = {"Key points": 0.45, "Matching": 0.15, "Mapping": 0.2, "Adjusting": 0.2}
"""Stages and their shares of the time."""


class StageProgress:
    """What has been done, over all stages.

    Args:
        report: Told every step, one at a time.
    """

    def __init__(self, report: ReportProgress) -> None:
        self._report, self._lock, self._done = report, threading.Lock(), 0.0

    def reach(self, stage: str, share: float, message: str = "") -> None:
        """So much of a stage is done, 0..1."""
        names = list(STAGES)
        before = sum(STAGES[name] for name in names[: names.index(stage)])
        with self._lock:
            self._done = max(self._done, before + share * STAGES[stage])
            self._report(Progress(stage, self._done, message))

    def count(self, stage: str, n: int, what: str, *, first: float = 0.0, last: float = 1.0) -> Callable[[float], None]:
        """For threads that work on n things each: a function to be told which share of one thing was done since.

        Args:
            stage: Its name.
            n: How many there are.
            what: What they are, as "cameras".
            first, last: Shares of the stage at the beginning and at the end.
        """
        lock, done = threading.Lock(), 0.0

        def advance(share: float) -> None:
            nonlocal done
            with lock:
                done += share
                counted = f"{int(done + 1e-6)} of {n} {what}"
                self.reach(stage, first + (last - first) * min(done / n, 1.0), counted)

        advance(0.0)
        return advance
