"""The frames of an export in the order in which they are written: as captured, or as the take plays them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from app.export.picked_frames import PickedFrames
from app.export.scene_frames import SceneFrames
from engine.errors import ProjectError
from engine.timing.timing import SourceMoment, TakeTiming

_DIGITS = 6
"""Moments nearer to each other than this are the same, so that repeats share what is made of them."""


@dataclass(frozen=True, slots=True)
class TakeFrame:
    """One frame of an export.

    Attributes:
        number: The frame of the capture, or that of the take where it has a timing.
        moments: What is seen, see SceneFrames.at_moments.
    """

    number: int
    moments: tuple[SourceMoment, ...]

    @property
    def frame(self) -> float:
        """The moment of the capture that most is seen of."""
        return max(self.moments, key=lambda moment: moment.weight).frame


def timing_of(scene: SceneFrames, *, has_timing: bool) -> TakeTiming | None:
    """The timing that an export follows; None where it is as captured.

    Args:
        has_timing: Whether the export applies the timing of the project.
    """
    timing = TakeTiming(scene.opened.project.document.timing, scene.opened.capture.n_frames)
    return timing if has_timing and not timing.is_as_captured else None


def take_frames(scene: SceneFrames, frames: PickedFrames | None, *, has_timing: bool) -> list[TakeFrame]:
    """The frames of an export.

    Args:
        frames: Of the capture; None for all that are trained. A take shows its frames that lie in their runs, and of
            these every so many.
        has_timing: See `timing_of`.
    Raises:
        ProjectError: There are none, or one is not trained.
    """
    timing = timing_of(scene, has_timing=has_timing)
    chosen: Iterable[int] = scene.trained_frames if frames is None else frames
    if timing is None:
        scene.check_trained(chosen)
        return [TakeFrame(frame, (SourceMoment(frame),)) for frame in chosen]
    outputs = taken_outputs(scene, timing, frames)
    found = [TakeFrame(output, _rounded(timing.source_at(output))) for output in outputs]
    scene.check_trained(moment.frame for one in found for moment in one.moments)
    return found


def taken_outputs(scene: SceneFrames, timing: TakeTiming, frames: PickedFrames | None) -> list[int]:
    """Output frames of a take that show nothing but chosen frames of the capture.

    Args:
        frames: As of `take_frames`.
    Raises:
        ProjectError: There are none.
    """
    is_chosen = np.zeros(timing.n_frames, bool)
    if frames is None:
        is_chosen[scene.trained_frames] = True
    else:
        for run in frames.runs:
            is_chosen[max(run.start, 0) : run.stop] = True
    sources, weights = timing.moments(np.arange(timing.n_output))
    nearest = np.ceil(sources - 0.5).astype(np.int64)  # whose clip shows it
    is_shown = (is_chosen[nearest] | (weights == 0)).all(axis=0)
    found = np.flatnonzero(is_shown)[:: 1 if frames is None else frames.step].tolist()
    if not found:
        raise ProjectError(
            "The take shows none of these frames.",
            hint="Choose other frames, train them, or leave the timing out.",
            path=scene.opened.project.folder,
        )
    return found


def _rounded(moments: Sequence[SourceMoment]) -> tuple[SourceMoment, ...]:
    def frame(moment: float) -> float:
        return int(moment) if moment.is_integer() else round(moment, _DIGITS)

    return tuple(SourceMoment(frame(one.frame), round(one.weight, _DIGITS)) for one in moments)
