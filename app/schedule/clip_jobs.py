"""What is left to train of a project, as jobs of a scheduler: which clips, and what each asks of its computer."""

from __future__ import annotations

import math
from dataclasses import dataclass

from app.plan.planning import plan_clip
from app.project.clips.clip_catalog import ClipCatalog
from app.project.project import Project
from engine.capture.capture import Capture
from engine.errors import ProjectError
from engine.parallel import n_cores
from engine.training.plan.plan import StepTime

MOST_CPUS = 8
"""Cores that a job asks for at most, however many this computer has."""

UNKNOWN_LIMIT_S = 24 * 3600
"""The time limit of a job where no forecast of its time is possible."""


@dataclass(frozen=True)
class ClipJobs:
    """Jobs for the clips that are left.

    Attributes:
        reference: The clip that has to be trained before the others. It has a job even where it is trained.
        sources: The other clips that are not trained yet, in ascending order.
        n_cpus: Cores of each job: as many as the forecast of its time is for, within MOST_CPUS.
        memory_mb: Memory of each job; the forecast, and a quarter more, and that of the process that waits for it.
        reference_s, source_s: Time limits, in whole minutes: three times the forecast, since computers differ, and ten
            minutes for a first start, which compiles.
        is_time_known: Whether they come from forecasts; else they are UNKNOWN_LIMIT_S.
        skipped: Clips that are damaged, or need one that is.
    """

    reference: int
    sources: tuple[int, ...]
    n_cpus: int
    memory_mb: int
    reference_s: int
    source_s: int
    is_time_known: bool
    skipped: tuple[int, ...]


def clip_jobs(project: Project, capture: Capture, chosen: range, step_time: StepTime) -> ClipJobs | None:
    """Jobs for clips of a project; None if all of them are trained.

    Args:
        capture: At the project's scale.
        chosen: Indices of the clips; the reference clip is trained in any case.
        step_time: See `plan_clip`.
    Raises:
        ProjectError: Each clip follows the one before, so that no two can be trained at once.
        CaptureError, PreparationError: The capture does not fit the settings.
    """
    settings, clips = project.settings, project.clips(capture.n_frames)
    if settings.config().follows_previous and len(clips) > 1:
        raise ProjectError(
            f"With these settings, each of the {len(clips)} clips follows the one before, so that no two can be "
            "trained at once.",
            hint="Train them one after the other with `clipgstream train`, or choose field=per_clip and start=scratch.",
            path=project.folder,
        )
    catalog = ClipCatalog(project, len(clips))
    skipped = tuple(i for i in chosen if catalog[i].state == "damaged" or catalog[i].blocked_by is not None)
    left = [index for index in chosen if index not in skipped and catalog[index].state != "trained"]
    if not left:
        return None
    reference = settings.reference_clip
    sources = tuple(index for index in left if index != reference)
    plans = [
        plan_clip(project, capture, clips[index], step_time=step_time)
        for index in (reference, max(sources, key=lambda index: clips[index].n_frames, default=reference))
    ]
    limits = [_limit_s(plan.seconds) for plan in plans]
    return ClipJobs(
        reference=reference,
        sources=sources,
        n_cpus=min(n_cores(), MOST_CPUS),
        memory_mb=256 * math.ceil((max(plan.memory_mb for plan in plans) * 1.25 + 500) / 256),
        reference_s=limits[0],
        source_s=limits[1],
        is_time_known=all(plan.seconds is not None for plan in plans),
        skipped=skipped,
    )


def _limit_s(seconds: float | None) -> int:
    """The time limit of a job.

    Args:
        seconds: The forecast, for all cores of this computer.
    """
    if seconds is None:
        return UNKNOWN_LIMIT_S
    return 60 * math.ceil(10 + 3 * seconds * max(n_cores() / MOST_CPUS, 1.0) / 60)
