"""Forecasts: cost of training the next clip, and of all clips that wait or are left, made on a thread.

One plan per kind and length of clip stands for all of them; clips trained before say most. The next clip is planned by
itself, while nothing trains.
"""

from __future__ import annotations

import logging
import shutil
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from app.background.latest import LatestWorker
from app.plan.makespan import Seldom, time_left
from app.plan.planning import clip_history, plan_clip, plan_status, sum_known
from app.plan.speed import known_step_time, step_time
from app.project.claims.holder_record import ClipProgress
from app.project.clips.clip_catalog import ClipCatalog, ClipRecord
from app.project.disk.discarding import progress_of
from app.project.project import Project
from app.status import PlanStatus, QueuedClip, QueueStatus, SequenceForecast
from app.training.due import due_clips, stale_clips
from app.training.own_settings import is_source
from app.training.service import TrainingService
from app.training.train_queue import needed_clips
from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.clip_files.clip_header import ClipHeader
from engine.errors import EngineError
from engine.training.config import TrainConfig
from engine.training.plan.forecast import MeasuredClip
from engine.training.plan.plan import StepSizes, StepTime, TrainingPlan, footage_of, make_plan, resumed_plan

logger = logging.getLogger(__name__)

Kind = tuple[bool, int]
"""Whether a clip begins with what another one has learned, and its number of frames."""


@dataclass(frozen=True, slots=True)
class ForecastRequest:
    """The clips to plan.

    Attributes:
        basis: The inputs of plans: settings, exclusions, and the revision of the catalog of clips.
        next_clip: None while something trains or nothing is left.
        can_measure: Whether nothing else computes, so that the machine may be timed.
    """

    basis: tuple[str, int]
    next_clip: Clip | None
    can_measure: bool
    project: Project = field(compare=False)
    capture: Capture = field(compare=False)
    clips: Sequence[Clip] = field(compare=False)
    catalog: ClipCatalog = field(compare=False)

    def is_answered_by(self, earlier: ForecastRequest) -> bool:
        """Whether what another request found says as much."""
        is_timed = earlier.can_measure or not self.can_measure
        return self.basis == earlier.basis and is_timed and self.next_clip in (None, earlier.next_clip)


@dataclass(frozen=True, slots=True, eq=False)
class Plans:
    """The plan of the next clip, and one for every kind of clip.

    Attributes:
        free_mb: Room on the disk, 10^6 bytes; None where not known.
    """

    next: TrainingPlan | None
    kinds: Mapping[Kind, TrainingPlan]
    free_mb: float | None = None


NO_PLANS, NOTHING = Plans(None, {}), SequenceForecast(0)


def kind_of(project: Project, clip: Clip, config: TrainConfig) -> Kind:
    """The kind of a clip. config: The project's settings."""
    return is_source(project.settings, config, clip.clip_index), clip.n_frames


def clip_forecast(plan: TrainingPlan | None, record: ClipRecord, *, begins_afresh: bool = False) -> SequenceForecast:
    """Of one clip that does not train.

    Args:
        plan: Of its kind; None until it was made.
        record: Its record on disk.
        begins_afresh: Whether it does not resume where it was stopped.
    """
    if plan is None:
        return SequenceForecast(1)
    if record.resume_step is not None and record.resume_n_steps and not begins_afresh:
        plan = resumed_plan(plan, record.resume_step, record.resume_n_steps)
    return SequenceForecast(1, plan.n_steps - plan.steps_done, plan.seconds, plan.disk_mb)


def together(parts: Sequence[SequenceForecast]) -> SequenceForecast:
    """All of them, one after the other."""
    return SequenceForecast(
        sum(part.n_clips for part in parts),
        sum(part.n_steps for part in parts),
        sum_known([part.seconds for part in parts]),
        sum_known([part.disk_mb for part in parts]),
    )


def at_once(
    own_s: Mapping[int, float | None],
    alone_s: Mapping[int, float | None],
    waiting_s: Mapping[int, float | None],
    needs: Mapping[int, Sequence[int]],
    n_workers: int,
) -> float | None:
    """Seconds until clips that train and those after them are finished; None where nobody can know.

    What they take from one another, as they share cores, shows in how much longer than planned they take; until that is
    known, several at a time are expected to take as long as one after the other.

    Args:
        own_s: What is left of those that train, by their own speed; None where they have none yet.
        alone_s: The same, as planned, if each trained alone.
        waiting_s: Of clips that come after them, in their order, if each trained alone.
        needs, n_workers: See `ends_of`.
    """
    known = [(own, alone) for own, alone in ((own, alone_s[index]) for index, own in own_s.items()) if own and alone]
    times_longer = float(n_workers)
    if len(own_s) > 1 and known:
        times_longer = sum(own for own, _ in known) / sum(alone for _, alone in known)
    first = {other for needed in needs.values() for other in needed}  # nothing trains next to these

    def expected_s(index: int, planned_s: float | None) -> float | None:
        return planned_s if planned_s is None or index in first else planned_s * times_longer

    going = {index: expected_s(index, alone_s[index]) if own is None else own for index, own in own_s.items()}
    waiting = {index: expected_s(index, planned_s) for index, planned_s in waiting_s.items()}
    return time_left(going, waiting, needs, n_workers)


@dataclass(frozen=True, slots=True, eq=False)
class Waiting:
    """The waiting clips and the work left, without the clips that train.

    Attributes:
        clips: As they are shown.
        queued, everything, stale: The work of those that wait, of all that are left, and of those that are out of date.
        queued_s, everything_s: Seconds that each of them takes, by clip, in the order of training.
        needs: Clips that have to be finished before each of them.
    """

    clips: tuple[QueuedClip, ...] = ()
    queued: SequenceForecast = NOTHING
    everything: SequenceForecast = NOTHING
    stale: SequenceForecast = NOTHING
    queued_s: Mapping[int, float | None] = field(default_factory=dict)
    everything_s: Mapping[int, float | None] = field(default_factory=dict)
    needs: Mapping[int, Sequence[int]] = field(default_factory=dict)


class Forecasts:
    """Forecasts of the open project. Methods are for one thread and do not wait."""

    def __init__(self) -> None:
        self._worker: LatestWorker[ForecastRequest, Plans] = LatestWorker("forecasts", self._compute)
        self._parts: list[SequenceForecast] = []
        self._kept = Waiting()
        self._queued_s, self._everything_s = Seldom(), Seldom()
        self._waiting_of: tuple[object, ...] = ()
        self._progress, self._progress_of = "", (Path(), -1)

    @property
    def newest(self) -> tuple[ForecastRequest, Plans] | None:
        """The plans made last."""
        return self._worker.newest

    def _ask(
        self, service: TrainingService, project: Project, capture: Capture, *, can_measure: bool
    ) -> tuple[ForecastRequest, tuple[ForecastRequest, Plans] | None]:
        """The request for plans now, and the last plans of this project; makes the request where those cover less."""
        basis = (f"{project.settings!r} {id(project.document.exclusions)}", service.catalog.revision)
        is_idle, index = not service.is_busy, service.next_clip_index
        next_clip = service.clips[index] if is_idle and index is not None else None
        request = ForecastRequest(
            basis, next_clip, can_measure and is_idle, project, capture, service.clips, service.catalog
        )
        newest = self._worker.newest
        if newest is None or not request.is_answered_by(newest[0]):
            self._worker.request(request)
        return request, None if newest is None or newest[0].project is not project else newest

    def next_clip(
        self, service: TrainingService, project: Project, capture: Capture, *, can_measure: bool
    ) -> PlanStatus | None:
        """The plan of the next clip as it is shown, its figures a moment later; None while something trains or nothing
        is left.

        Args:
            can_measure: Whether nothing else computes, so that the machine may be timed.
        """
        request, newest = self._ask(service, project, capture, can_measure=can_measure)
        if request.next_clip is None:
            return None
        plan = None
        if newest is not None and (newest[0].next_clip, newest[0].basis) == (request.next_clip, request.basis):
            plan = newest[1].next  # until the machine is timed
        can_edit = project.is_writable and not service.catalog.has_finished_clips
        if self._progress_of != (key := (project.folder, service.catalog.revision)):
            self._progress_of, self._progress = key, progress_of(project).progress_words
        return plan_status(project, capture, request.next_clip, plan, can_edit=can_edit, discards=self._progress)

    def queue(self, service: TrainingService, project: Project, capture: Capture, *, can_measure: bool) -> QueueStatus:
        """The queue as it is shown, its figures a moment later."""
        _, newest = self._ask(service, project, capture, can_measure=can_measure)
        plans = NO_PLANS if newest is None else newest[1]
        waiting, running = self._waiting(service, project, plans.kinds), service.progress
        going = [_running_part(one, self._parts[index]) for index, one in running.items()]
        alone_s = {index: _planned_left_s(one, self._parts[index]) for index, one in running.items()}
        own_s = {index: one.eta_s for index, one in running.items()}
        n_workers = max(service.n_workers + len(service.elsewhere), 1)

        def at_once_with(rest_s: Mapping[int, float | None], kept: Seldom) -> float | None:
            basis = (waiting, n_workers, *running)
            return kept.value(basis, lambda: at_once(own_s, alone_s, rest_s, waiting.needs, n_workers))

        queued, everything = (
            replace(together([*going, rest]), seconds=at_once_with(rest_s, kept))
            for rest, rest_s, kept in (
                (waiting.queued, waiting.queued_s, self._queued_s),
                (waiting.everything, waiting.everything_s, self._everything_s),
            )
        )
        n_done = service.queue.steps_done + sum(one.step for one in running.values())
        return QueueStatus(
            waiting=waiting.clips,
            failed=tuple(sorted(service.queue.failed.items())),
            is_held=service.queue.is_held and bool(waiting.clips),
            is_ending_after=service.is_ending_after,
            queued=queued if queued.n_clips else None,
            everything=everything if everything.n_clips else None,
            stale=waiting.stale if waiting.stale.n_clips else None,
            progress=n_done / max(n_done + queued.n_steps, 1),
            n_done=service.queue.n_done,
            free_mb=plans.free_mb,
            live_view=service.looked_at.mode,
        )

    def _waiting(self, service: TrainingService, project: Project, kinds: Mapping[Kind, TrainingPlan]) -> Waiting:
        """The part that does not depend on the clip that trains; made anew only when something has changed, since
        clips may be thousands and this is asked for at every change of the picture."""
        queue, running = service.queue, service.in_training
        clips = tuple(queue)
        own = tuple(index for index in clips if queue.own_settings(index) is not None)
        waiting_of = (id(service), service.catalog.revision, kinds, running, clips, own)
        if waiting_of == self._waiting_of:
            return self._kept
        self._waiting_of = waiting_of
        parts = self._parts = _clip_parts(service, project, kinds, own)
        due, coming = {*due_clips(service.catalog), *clips}.difference(running), running.union(clips)
        waiting = [index for index in clips if index not in running]
        left = [*waiting, *sorted(due.difference(clips))]
        config = project.settings.config()
        self._kept = Waiting(
            tuple(QueuedClip(index, parts[index].n_steps, parts[index].seconds, index in own) for index in clips),
            together([parts[index] for index in waiting]),
            together([parts[index] for index in left]),
            together([parts[index] for index in stale_clips(service.catalog) if index not in coming]),
            {index: parts[index].seconds for index in waiting},
            {index: parts[index].seconds for index in left},
            {index: needed_clips(project, index, config) for index in (*running, *left)},
        )
        return self._kept

    def forget(self) -> None:
        """Another capture was opened."""
        self._worker.forget()
        self._waiting_of = ()

    def close(self) -> None:
        """End the thread, and the process in which it times the machine."""
        self._worker.close()

    def _compute(self, request: ForecastRequest) -> Plans:
        def timed(sizes: StepSizes, phase: str) -> float | None:
            return step_time(sizes, phase, lambda: not self._worker.is_closed)

        return _plans(request, timed if request.can_measure else known_step_time)


def _clip_parts(
    service: TrainingService, project: Project, kinds: Mapping[Kind, TrainingPlan], own: Sequence[int]
) -> list[SequenceForecast]:
    """One per clip, as if none trained. own: Those that begin afresh, with settings of their own."""
    config = project.settings.config()
    return [
        clip_forecast(
            kinds.get(kind_of(project, clip, config)),
            service.catalog[clip.clip_index],
            begins_afresh=clip.clip_index in own,
        )
        for clip in service.clips
    ]


def _running_part(run: ClipProgress, whole: SequenceForecast) -> SequenceForecast:
    """The work left on the clip that trains: by its own speed once it has one, else by its plan."""
    if not run.n_steps:
        return whole
    left_s = _planned_left_s(run, whole)
    return SequenceForecast(1, run.n_steps - run.step, left_s if run.eta_s is None else run.eta_s, whole.disk_mb)


def _planned_left_s(run: ClipProgress, whole: SequenceForecast) -> float | None:
    share = run.step / run.n_steps if run.n_steps else 0.0
    return None if whole.seconds is None else whole.seconds * (1.0 - share)


# ---------------------------------------------------------------- on the thread


def _plans(request: ForecastRequest, timed: StepTime) -> Plans:
    free_mb, history = None, clip_history(request.project, len(request.clips), request.catalog)
    with suppress(OSError):
        free_mb = shutil.disk_usage(request.project.folder).free / 1e6
    kinds, next_plan = {}, None
    try:
        if request.next_clip is not None:
            next_plan = plan_clip(
                request.project,
                request.capture,
                request.next_clip,
                step_time=timed,
                history=history,
                catalog=request.catalog,
            )
        kinds = plans_of_kinds(
            request.project, request.capture, request.clips, request.catalog, step_time=timed, history=history
        )
    except EngineError as error:  # training will say the same
        logger.info("clips cannot be planned: %s", error)
    return Plans(next_plan, kinds, free_mb)


def plans_of_kinds(
    project: Project,
    capture: Capture,
    clips: Sequence[Clip],
    catalog: ClipCatalog,
    *,
    step_time: StepTime = known_step_time,
    history: Sequence[MeasuredClip] | None = None,
) -> dict[Kind, TrainingPlan]:
    """One plan for every kind of these clips, without looking at pictures.

    Args:
        project, capture: As for `plan_clip`.
        clips: Those of the project, or some of them.
        catalog: Says which of them are trained.
        step_time, history: As for `plan_clip`; by default nothing is timed.
    Raises:
        PreparationError: The capture does not fit the settings.
    """
    if history is None:
        history = clip_history(project, len(project.clips(capture.n_frames)))
    capture = capture.without(project.document.exclusions)
    config = project.settings.config()
    footage = footage_of(capture, capture.camera_indices(project.settings.holdout))
    found = project.headers.read(project.reference_path)
    reference: ClipHeader | None = None if found is None else found.header
    plans: dict[Kind, TrainingPlan] = {}
    # a clip says nothing of itself: one that is not finished can stand for those that are
    for clip in sorted(clips, key=lambda clip: catalog[clip.clip_index].state == "trained"):
        kind = begins_with_other, _ = kind_of(project, clip, config)
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
            step_time=step_time,
        )
    return plans
