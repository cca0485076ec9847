"""The memory that a training takes, as it is declared to a cluster."""

from __future__ import annotations

from collections.abc import Sequence

from app.plan.planning import plan_clip
from app.project.project import Project
from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.errors import EngineError

UNKNOWN_BYTES = 2 << 30
"""Where no plan can be made: training says why."""


def training_bytes(project: Project, capture: Capture, clips: Sequence[Clip]) -> int:
    """The most that the reference clip or one of the others is expected to take."""
    reference = project.settings.reference_clip
    source = next((clip.clip_index for clip in clips if clip.clip_index != reference), reference)
    try:
        plans = [plan_clip(project, capture, clips[index], step_time=_unknown) for index in {reference, source}]
    except EngineError:
        return UNKNOWN_BYTES
    return int(1e6 * max(plan.memory_mb for plan in plans))


def _unknown(*asked: object) -> None:
    """How long a step takes does not matter here."""
