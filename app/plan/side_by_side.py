"""How many clips train side by side on one machine: as many as its cores, and only where its memory suffices.

Trainings that run side by side divide the cores. More of them than cores would take turns, which is slower than one
after the other and takes more memory; so there are never more than cores, with a sentence about it. Too little memory
is an error: trainings would be killed hours later, or the machine would stand still.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from app.plan.forecasts import Kind, kind_of, plans_of_kinds
from app.project.clips.clip_catalog import ClipCatalog
from app.project.project import Project
from app.training.train_queue import needed_clips
from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.errors import ProjectError
from engine.machine import free_memory_bytes, memory_bytes
from engine.parallel import n_cores
from engine.training.plan.plan import TrainingPlan


@dataclass(frozen=True, slots=True)
class SideBySide:
    """How many clips train at the same time.

    Attributes:
        n_workers: So many, at least one.
        why_fewer: Why that is less than what was asked for, one sentence; empty where it is not, or where there are
            just not as many clips.
    """

    n_workers: int
    why_fewer: str = ""


def side_by_side(
    n_wanted: int, *, n_ready: int, is_chain: bool, n_cores: int, clip_mb: float, free_mb: float | None
) -> SideBySide:
    """How many of the wanted trainings run side by side on a machine.

    Args:
        n_wanted: Asked for, at least one.
        n_ready: Clips of which none needs another one.
        is_chain: Whether each clip continues from the one before it.
        n_cores: Of the machine, without those that are left to others.
        clip_mb: Memory of the largest of these clips while it trains, 10^6 bytes.
        free_mb: Memory of the machine that trainings may take; None where that is not known.
    Raises:
        ProjectError: Memory does not suffice for as many.
    """
    if n_wanted == 1:
        return SideBySide(1)
    if is_chain:
        return SideBySide(1, "Clips train one after another: each continues from the one before it.")
    n_workers = min(n_wanted, max(n_cores, 1), max(n_ready, 1))
    if n_workers > 1 and free_mb is not None and n_workers * clip_mb > free_mb:
        n_fitting = max(int(free_mb // clip_mb), 1)
        raise ProjectError(
            f"{n_workers} clips side by side need about {n_workers * clip_mb / 1e3:.1f} GB of memory, "
            f"{clip_mb / 1e3:.1f} GB each; {free_mb / 1e3:.1f} GB are free.",
            hint=f"Use --workers {n_fitting}, end other programs, or choose shorter clips or a smaller scale.",
        )
    if n_cores >= min(n_wanted, max(n_ready, 1)):
        return SideBySide(n_workers)
    return SideBySide(
        n_workers,
        f"{n_workers} instead of {n_wanted} clips train side by side: on {n_cores} "
        f"core{'s' if n_cores > 1 else ''}, more would only take turns and need more memory.",
    )


@dataclass(frozen=True, slots=True)
class PlannedClips:
    """What is known of clips before they are trained on this machine.

    Attributes:
        together: How many train side by side.
        kinds: A plan of every kind of them, as if trained alone on all cores of this machine.
        times_longer: How much longer one takes next to others, but for the reference clip, which comes alone.
    """

    together: SideBySide
    kinds: dict[Kind, TrainingPlan]
    times_longer: float = 1.0

    def expected_s(self, project: Project, clip: Clip) -> float | None:
        """How long a clip takes next to the others; None where nobody can know."""
        config = project.settings.config()
        plan = self.kinds.get(kind_of(project, clip, config))
        if plan is None or plan.seconds is None:
            return None
        is_alone = clip.clip_index == project.settings.reference_clip and not config.independent
        return plan.seconds if is_alone else plan.seconds * self.times_longer


def plan_here(
    project: Project, capture: Capture, clips: Sequence[Clip], catalog: ClipCatalog, n_wanted: int
) -> PlannedClips:
    """How clips train on this machine as it is now.

    Args:
        project, capture: Those that are trained.
        clips: Those to be trained.
        catalog: Of the project.
        n_wanted: How many were asked for side by side.
    Raises:
        ProjectError: Memory does not suffice for as many.
        PreparationError: The capture does not fit the settings.
    """
    if not clips or n_wanted == 1:  # needs no forecast
        return PlannedClips(SideBySide(1), {})
    kinds, config = plans_of_kinds(project, capture, clips, catalog), project.settings.config()
    indices = {clip.clip_index for clip in clips}
    followers = [clip for clip in clips if not indices.isdisjoint(needed_clips(project, clip.clip_index, config))]
    ready = followers or clips  # what the reference clip comes before trains without it
    free = free_memory_bytes()
    if free is None:
        free = memory_bytes()
    together = side_by_side(
        n_wanted,
        n_ready=len(ready),
        is_chain=config.follows_previous,
        n_cores=n_cores(),
        clip_mb=max(kinds[kind_of(project, clip, config)].memory_mb for clip in ready),
        free_mb=None if free is None else free / 1e6,
    )
    return PlannedClips(together, kinds, together.n_workers)
