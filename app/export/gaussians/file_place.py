"""Where the scene lies in exported files of Gaussians."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from app.evaluation.headless import TrainedProject
from app.export.jobs.placing import Vector
from engine.export.world import FileWorld, world


class PlacedInFile(Protocol):
    """What a job says of it; see app.export.jobs.placing."""

    @property
    def up(self) -> str | None: ...
    @property
    def scale(self) -> float | None: ...
    @property
    def scene_up(self) -> Vector | None: ...


def file_world(
    opened: TrainedProject, job: PlacedInFile, *, usual_up: str | None = None, is_rub: bool = False
) -> FileWorld:
    """The scene's place in the files.

    Args:
        usual_up: The axis that is up where the job does not say; None as in the capture.
        is_rub: See engine.export.world.world.
    """
    said = opened.project.document.world.meters_per_unit
    scale = job.scale if job.scale is not None else 1.0 if said is None else said
    scene_up = opened.up if job.scene_up is None else np.array(job.scene_up)
    return world(scene_up, up=job.up or usual_up, scale=scale, is_rub=is_rub)


def file_meters_per_unit(opened: TrainedProject, placement: FileWorld) -> float | None:
    """Length of a unit of files with this placement, m; None where the project does not say how long its unit is."""
    said = opened.project.document.world.meters_per_unit
    return None if said is None else said / placement.scale
