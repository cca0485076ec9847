"""What training many clips one after another takes: steps, time and disk of all that waits, and of all that is left.

One plan per kind and length of clip stands for all of them; clips trained before say most. Plans are made on a thread.
"""

from __future__ import annotations

import logging
import shutil
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

from app.background.latest import LatestWorker
from app.plan.planning import clip_history
from app.plan.speed import known_step_time, step_time
from app.project.clips.clip_catalog import ClipCatalog, ClipRecord
from app.project.project import Project
from app.status import QueuedClip, QueueStatus, SequenceForecast
from app.training.own_settings import is_source
from app.training.service import TrainingService
from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.clip_files.clip_header import ClipHeader
from engine.errors import EngineError
from engine.training.plan.plan import StepSizes, StepTime, TrainingPlan, footage_of, make_plan

logger = logging.getLogger(__name__)

Kind = tuple[bool, int]
"""Whether a clip begins with what another one has learned, and its number of frames."""


@dataclass(frozen=True, slots=True)
class SequenceRequest:
    """What plans of kinds depend on."""

    basis: tuple[str, int]
    can_measure: bool
    project: Project = field(compare=False)
    capture: Capture = field(compare=False)
    clips: Sequence[Clip] = field(compare=False)
    catalog: ClipCatalog = field(compare=False)


@dataclass(frozen=True, slots=True, eq=False)
class Kinds:
    """A plan for every kind of clip.

    Attributes:
        free_mb: Room on the disk, 10^6 bytes; None where not known.
    """

    plans: Mapping[Kind, TrainingPlan]
    free_mb: float | None = None


NO_KINDS, NOTHING = Kinds({}), SequenceForecast(0)


@dataclass(frozen=True, slots=True)
class ClipForecast:
    """What is left to do for one clip; None where nobody can know."""

    n_steps: int
    seconds: float | None
    disk_mb: float | None


def clip_forecast(plan: TrainingPlan | None, record: ClipRecord, *, begins_afresh: bool = False) -> ClipForecast:
    """Of a clip that does not train.

    Args:
        plan: Of its kind; None until it was made.
        record: What lies on disk of it.
        begins_afresh: Whether it does not go on where it was stopped.
    """
    if plan is None:
        return ClipForecast(0, None, None)
    n_steps, preparation_s, training_s = plan.n_steps, plan.preparation_s.value, plan.training_s.value
    if record.resume_step is not None and record.resume_n_steps and not begins_afresh:
        left = 1.0 - record.resume_step / record.resume_n_steps
        n_steps = record.resume_n_steps - record.resume_step
        preparation_s, training_s = 0.0, None if training_s is None else training_s * left
    seconds = None if preparation_s is None or training_s is None else preparation_s + training_s
    return ClipForecast(n_steps, seconds, plan.disk_mb.value)


def together(parts: Sequence[ClipForecast]) -> SequenceForecast:
    """All of them, one after the other."""
    return SequenceForecast(
        len(parts),
        sum(part.n_steps for part in parts),
        _sum([part.seconds for part in parts]),
        _sum([part.disk_mb for part in parts]),
    )


def sequence_forecast(going: Sequence[ClipForecast], later: SequenceForecast) -> SequenceForecast | None:
    """The clip that trains, if any, and what comes after it; None of nothing."""
    if not going and not later.n_clips:
        return None
    now = together(going)
    return SequenceForecast(
        now.n_clips + later.n_clips,
        now.n_steps + later.n_steps,
        _sum([now.seconds, later.seconds]),
        _sum([now.disk_mb, later.disk_mb]),
    )


def _sum(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return sum(known) if len(known) == len(values) else None


@dataclass(frozen=True, slots=True)
class Waiting:
    """What waits and what is left, without the clip that trains."""

    clips: tuple[QueuedClip, ...] = ()
    queued: SequenceForecast = NOTHING
    everything: SequenceForecast = NOTHING
    stale: SequenceForecast = NOTHING


class SequencePlan:
    """Forecasts of the open project. Methods are for one thread and do not wait."""

    def __init__(self) -> None:
        self._worker: LatestWorker[SequenceRequest, Kinds] = LatestWorker("sequence", self._kinds)
        self._parts: list[ClipForecast] = []
        self._kept = Waiting()
        self._waiting_of: tuple[object, ...] = ()

    @property
    def newest(self) -> tuple[SequenceRequest, Kinds] | None:
        """The plans made last."""
        return self._worker.newest

    def status(self, service: TrainingService, project: Project, capture: Capture, *, can_measure: bool) -> QueueStatus:
        """The queue as it is shown, its figures a moment later.

        Args:
            can_measure: Whether nothing else computes, so that the machine may be timed.
        """
        basis = (f"{project.settings!r} {id(project.document.exclusions)}", service.catalog.revision)
        can_measure = can_measure and service.worker is None
        request = SequenceRequest(basis, can_measure, project, capture, service.clips, service.catalog)
        newest = self._worker.newest
        is_known = newest is not None and newest[0].basis == basis and (newest[0].can_measure or not can_measure)
        if not is_known:
            self._worker.request(request)
        kinds = NO_KINDS if newest is None or newest[0].project is not project else newest[1]
        running, steps = service.running_clip, service.steps_of_run
        waiting = self._waiting(service, project, kinds)
        going = () if running is None else (_running_part(service, self._parts[running]),)
        queued, everything = sequence_forecast(going, waiting.queued), sequence_forecast(going, waiting.everything)
        n_done = service.queue.steps_done + steps[0]
        return QueueStatus(
            waiting=waiting.clips,
            failed=tuple(sorted(service.queue.failed.items())),
            is_held=service.queue.is_held and bool(waiting.clips),
            is_ending_after=service.is_ending_after,
            queued=queued,
            everything=everything,
            stale=waiting.stale if waiting.stale.n_clips else None,
            progress=n_done / max(n_done + (0 if queued is None else queued.n_steps), 1),
            n_done=service.queue.n_done,
            free_mb=kinds.free_mb,
            live_view=service.live_view,
        )

    def _waiting(self, service: TrainingService, project: Project, kinds: Kinds) -> Waiting:
        """What does not depend on the clip that trains; made anew only when something has changed, since clips may be
        thousands and this is asked for at every change of the picture."""
        queue, running = service.queue, service.running_clip
        clips = tuple(queue)
        own = tuple(index for index in clips if queue.own_settings(index) is not None)
        waiting_of = (id(service), service.catalog.revision, kinds, running, clips, own)
        if waiting_of == self._waiting_of:
            return self._kept
        self._waiting_of = waiting_of
        parts = self._parts = _clip_parts(service, project, kinds, own)
        due = {*service.unfinished, *clips} - {running}
        self._kept = Waiting(
            tuple(QueuedClip(index, parts[index].n_steps, parts[index].seconds, index in own) for index in clips),
            together([parts[index] for index in clips]),
            together([parts[index] for index in sorted(due)]),
            together([parts[index] for index in service.stale if index not in queue and index != running]),
        )
        return self._kept

    def forget(self) -> None:
        """Another capture was opened."""
        self._worker.forget()
        self._waiting_of = ()

    def close(self) -> None:
        """End the thread, and the process in which it times the machine."""
        self._worker.close()

    def _kinds(self, request: SequenceRequest) -> Kinds:
        def timed(sizes: StepSizes, phase: str) -> float | None:
            return step_time(sizes, phase, lambda: not self._worker.is_closed)

        return _kinds(request, timed if request.can_measure else known_step_time)


def _clip_parts(service: TrainingService, project: Project, kinds: Kinds, own: Sequence[int]) -> list[ClipForecast]:
    """One per clip, as if none trained. own: Those that begin afresh, with settings of their own."""
    settings, config = project.settings, project.settings.config()
    return [
        clip_forecast(
            kinds.plans.get((is_source(settings, config, clip.clip_index), clip.n_frames)),
            service.catalog[clip.clip_index],
            begins_afresh=clip.clip_index in own,
        )
        for clip in service.clips
    ]


def _running_part(service: TrainingService, whole: ClipForecast) -> ClipForecast:
    """What is left of the clip that trains: by its own speed once it has one, else by its plan."""
    step, n_steps = service.steps_of_run
    eta_s = service.eta_s
    if not n_steps:
        return whole
    left_s = None if whole.seconds is None else whole.seconds * (1.0 - step / n_steps)
    return ClipForecast(n_steps - step, left_s if eta_s is None else eta_s, whole.disk_mb)


# ---------------------------------------------------------------- on the thread


def _kinds(request: SequenceRequest, timed: StepTime) -> Kinds:
    free_mb = None
    with suppress(OSError):
        free_mb = shutil.disk_usage(request.project.folder).free / 1e6
    try:
        return Kinds(_plans(request, timed), free_mb)
    except EngineError as error:  # training will say the same
        logger.info("the clips cannot be planned: %s", error)
        return Kinds({}, free_mb)


def _plans(request: SequenceRequest, timed: StepTime) -> dict[Kind, TrainingPlan]:
    project, capture = request.project, request.capture.without(request.project.document.exclusions)
    config = project.settings.config()
    history = clip_history(project, len(request.clips))
    footage = footage_of(capture, capture.camera_indices(project.settings.holdout))
    found = project.headers.read(project.reference_path)
    reference: ClipHeader | None = None if found is None else found.header
    plans: dict[Kind, TrainingPlan] = {}
    # a clip says nothing of itself: one that is not finished can stand for those that are
    for clip in sorted(request.clips, key=lambda clip: request.catalog[clip.clip_index].state == "trained"):
        begins_with_other = is_source(project.settings, config, clip.clip_index)
        kind = (begins_with_other, clip.n_frames)
        if kind in plans:
            continue
        goes_on = begins_with_other and config.independent
        plans[kind] = make_plan(
            footage,
            clip,
            config.going_on() if goes_on else config,
            is_source=begins_with_other,
            reference=reference if begins_with_other else None,
            history=history,
            step_time=timed,
        )
    return plans
