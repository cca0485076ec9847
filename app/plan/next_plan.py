"""NextPlan: what training the next clip would take, found out on a thread while nothing trains."""

from __future__ import annotations

import logging
from dataclasses import dataclass, field
from pathlib import Path

from app.background.latest import LatestWorker
from app.plan.planning import plan_clip, plan_status
from app.plan.speed import step_time
from app.project.clips.clip_catalog import ClipCatalog
from app.project.disk.discarding import progress_of
from app.project.project import Project
from app.status import PlanStatus
from app.training.service import TrainingService
from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.errors import EngineError
from engine.training.plan.plan import StepSizes, TrainingPlan

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class PlanRequest:
    """The next clip, to be planned.

    Attributes:
        basis: What the plan depends on: settings, and the revision of the catalog of clips.
        can_measure: Whether nothing else computes, so that the machine may be timed.
    """

    clip: Clip
    basis: tuple[str, int]
    can_measure: bool
    project: Project = field(compare=False)
    capture: Capture = field(compare=False)
    catalog: ClipCatalog = field(compare=False)


class NextPlan:
    """Asks for the plan of the clip that would be trained next. Methods are for one thread and do not wait."""

    def __init__(self) -> None:
        self._plans: LatestWorker[PlanRequest, TrainingPlan | None] = LatestWorker("plans", self._compute)
        self._progress, self._progress_of = "", (Path(), -1)

    @property
    def newest(self) -> tuple[PlanRequest, TrainingPlan | None] | None:
        """The plan made last."""
        return self._plans.newest

    @property
    def is_busy(self) -> bool:
        """Whether a plan is being made, for which the machine may be timed."""
        return self._plans.is_busy

    def status(
        self, service: TrainingService, project: Project, capture: Capture, *, can_measure: bool
    ) -> PlanStatus | None:
        """The plan as it is shown, its figures a moment later; None while something trains or nothing is left."""
        clip_index = service.next_clip_index
        if clip_index is None or service.worker is not None:
            return None
        clip = service.clips[clip_index]
        basis = (f"{project.settings!r} {id(project.document.exclusions)}", service.catalog.revision)
        request = PlanRequest(clip, basis, can_measure, project, capture, service.catalog)
        newest, plan = self._plans.newest, None
        if newest is None or newest[0] != request:
            self._plans.request(request)
        if newest is not None and (newest[0].clip, newest[0].basis) == (clip, basis):  # until the machine is timed
            plan = newest[1]
        can_edit = project.is_writable and not service.catalog.has_finished_clips
        if self._progress_of != (key := (project.folder, service.catalog.revision)):
            self._progress_of, self._progress = key, progress_of(project).progress_words
        return plan_status(project, capture, clip, plan, can_edit=can_edit, discards=self._progress)

    def forget(self) -> None:
        """Another capture was opened."""
        self._plans.forget()

    def close(self) -> None:
        """End the thread, and the process in which it times the machine."""
        self._plans.close()

    def _compute(self, request: PlanRequest) -> TrainingPlan | None:
        def timed(sizes: StepSizes, phase: str) -> float | None:
            return step_time(sizes, phase, lambda: not self._plans.is_closed) if request.can_measure else None

        try:
            return plan_clip(request.project, request.capture, request.clip, step_time=timed, catalog=request.catalog)
        except EngineError as error:  # training will say the same
            logger.info("the next clip cannot be planned: %s", error)
            return None
