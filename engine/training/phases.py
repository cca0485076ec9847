"""The phases of a clip's training: their names, their steps, and where in them a step lies."""

from __future__ import annotations

from collections.abc import Sequence

from engine.training.config import MOVING_SHARE, TrainConfig


def phases_of(
    config: TrainConfig, *, n_cameras: int, n_frames: int, n_windows: int, is_source: bool
) -> list[tuple[str, int]]:
    """Name and number of steps of every phase, in order.

    Args:
        config: Gives the steps.
        n_cameras, n_frames: Training cameras, and frames of the clip.
        n_windows: Windows of a picture, one of which a step draws.
        is_source: Whether the clip inherits from another one.
    """
    n_pictures = n_cameras * n_frames
    if config.cloud == "frames" and not is_source:  # one cloud, so there is nothing to begin with
        return [("joint", config.n_joint_steps(n_pictures, n_windows))]
    if is_source:
        return [("source", config.n_source_steps(n_pictures, n_windows))]
    n_joint_steps, static = config.n_joint_steps(n_pictures, n_windows), config.n_static_steps(n_cameras, n_windows)
    if config.gate == "off":  # every anchor moves
        return [("static", static), ("joint", n_joint_steps)]
    n_alone = round(MOVING_SHARE * n_joint_steps)
    return [("static", static), ("joint", n_joint_steps - n_alone), ("moving", n_alone)]


def phase_at(phases: Sequence[tuple[str, int]], step: int) -> tuple[int, int]:
    """Index of the phase in which a step lies, and steps before it in that phase; the last one has no end.

    Args:
        phases: At least one.
        step: Steps done in all phases together.
    """
    for index, (_, n_steps) in enumerate(phases[:-1]):
        if step < n_steps:
            return index, step
        step -= n_steps
    return len(phases) - 1, step
