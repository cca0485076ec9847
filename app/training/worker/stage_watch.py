"""StageWatch: seconds of wall time of each stage of a training. Pauses are left out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

STARTING = "Starting"
TRAINING = "Training"
KEEPING = "Measuring and keeping"
"""Held-out figures, live snapshots and checkpoints in between the steps."""


class StageWatch:
    """Time always runs for one stage, or for none.

    Args:
        clock: Seconds; tests bring their own.
        seconds: Times of earlier runs of the same training.
    """

    def __init__(self, clock: Callable[[], float], seconds: Mapping[str, float] | None = None) -> None:
        self._clock = clock
        self._stage: str | None = None
        self._since_s = 0.0
        self.seconds: dict[str, float] = dict(seconds or {})

    def enter(self, stage: str | None) -> str | None:
        """Time runs for this stage from now on, for none when None. Returns the stage before."""
        now_s, before = self._clock(), self._stage
        if before is not None:
            self.seconds[before] = self.seconds.get(before, 0.0) + now_s - self._since_s
        self._stage, self._since_s = stage, now_s
        return before

    def reached(self, stage: str, done: float) -> None:
        """A report of progress. It comes after the piece of work that it reports, unless its share is 0."""
        if done > 0 and self._stage is not None:
            self._stage = stage
        self.enter(stage)

    @property
    def training_s(self) -> float:
        """Of the steps so far, with measuring and writing between them."""
        self.enter(self._stage)
        return sum(self.seconds.get(stage, 0.0) for stage in (TRAINING, KEEPING))

    def document(self) -> dict[str, Any]:
        """JSON-able: stages_s by name in the order they were entered; preparation_s and training_s, together all of it.

        Training is the steps, with measuring and writing between them; everything else is preparation, also where a
        step begins a new phase.
        """
        training_s = self.training_s
        return {
            "stages_s": {stage: round(seconds, 3) for stage, seconds in self.seconds.items()},
            "preparation_s": round(sum(self.seconds.values()) - training_s, 3),
            "training_s": round(training_s, 3),
        }
