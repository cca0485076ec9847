"""Which moments of a capture a video shows, picture by picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from engine.timing.timing import SourceMoment, TakeTiming

SNAP = 1e-6
"""Moments as near as this to a frame are that frame: what adding up steps leaves of rounding."""


@dataclass(frozen=True, slots=True)
class Moment:
    """The moment of one picture, in frames of the capture, between frames too.

    Attributes:
        scene: Of what is seen; where a take fades, of what most is seen of.
        view: Of the camera that moves.
        fading: The moments that fade into each other; none where there is one only.
    """

    scene: float
    view: float
    fading: tuple[SourceMoment, ...] = ()

    @property
    def is_whole(self) -> bool:
        """Whether the capture has a frame of it."""
        return self.scene == round(self.scene) and not self.fading

    @property
    def sources(self) -> tuple[SourceMoment, ...]:
        """All moments that are seen."""
        return self.fading or (SourceMoment(self.scene),)


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


def timed_moments(timing: TakeTiming, runs: Sequence[range], step: float) -> list[Moment]:
    """The same for a take: runs are of its frames, and the camera moves with the frames of the capture.

    Args:
        timing: Of the take.
        runs, step: As of `moments_of`, in output frames.
    """
    outputs = np.array([moment.view for moment in moments_of(runs, step)])
    found: list[Moment] = []
    for frames, weights in zip(*(values.T.tolist() for values in timing.moments(outputs)), strict=True):
        parts = tuple(SourceMoment(*part) for part in zip(frames, weights, strict=True) if part[1] > 0)
        main = max(parts, key=lambda part: part.weight).frame
        found.append(Moment(main, main, parts if len(parts) > 1 else ()))
    return found
