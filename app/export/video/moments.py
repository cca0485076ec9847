"""Which moments of a capture a video shows, picture by picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

SNAP = 1e-6
"""Moments as near as this to a frame are that frame: what adding up steps leaves of rounding."""


@dataclass(frozen=True, slots=True)
class Moment:
    """The moment of one picture, in frames of the capture, between frames too.

    Attributes:
        scene: Of what is seen.
        view: Of the camera that moves.
    """

    scene: float
    view: float

    @property
    def is_whole(self) -> bool:
        """Whether the capture has a frame of it."""
        return self.scene == round(self.scene)


def moments_of(runs: Sequence[range], step: float, hold: float | None = None) -> list[Moment]:
    """Moments from the first frame of each run up to its last one, a step apart.

    Args:
        runs: Frames without gaps, one after another.
        step: Frames from one picture to the next, above 0.
        hold: Moment at which the scene stands still; None for none.
    """
    views = [_snapped(run[0] + k * step) for run in runs for k in range(int((len(run) - 1) / step + SNAP) + 1)]
    return [Moment(view if hold is None else hold, view) for view in views]


def _snapped(moment: float) -> float:
    return float(round(moment)) if abs(moment - round(moment)) < SNAP else moment
