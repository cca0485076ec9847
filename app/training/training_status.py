"""Status of a project's trainings for display: values made of its service, one of the training, one of every clip."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

from msgspec.structs import asdict

from app.project.claims.claims import Elsewhere
from app.project.claims.holder_record import ClipProgress, MachineLoad, machine_name
from app.project.clips.clip_catalog import ClipRecord
from app.status import ClipStatus, MachineStatus, RunningClip, TrainingStatus
from app.training.curves import Curves
from app.training.messages import ClipTrained
from app.training.service import TrainingService
from app.training.stage_order import stage_number

_WORDS = {"starting": "preparing", "preparing": "preparing", "paused": "paused"}
"""States of a run that a clip has by another name; it is "training" in all others."""


def training_status(service: TrainingService, viewed_clip: int | None = None) -> TrainingStatus:
    """All trainings as one value, led by that of the viewed clip, else by the one that began first or ended last.

    Args:
        viewed_clip: The clip at the playhead. Its curves are shown while nothing trains, too.
    """
    run = service.shown_run if viewed_clip is None else service.runs.get(viewed_clip, service.shown_run)
    settings = service.project.settings
    state, step = ("idle", None) if run is None else (run.state, run.last_step)
    stage = "" if run is None else run.stage.stage
    clip_index = None if run is None else run.clip_index
    curve_clip = clip_index if service.is_busy or viewed_clip is None else viewed_clip
    curves = None if curve_clip is None else curves_of(service, curve_clip)
    upcoming = service.next_clip_index
    is_reference = clip_index == settings.reference_clip or settings.config().independent
    number, n_stages = stage_number(stage, is_reference=is_reference) if step is None else (0, 0)
    done = 0.0 if run is None else run.stage.done
    trainings = running_clips(service)
    return TrainingStatus(
        state=state,
        clip_index=clip_index,
        n_running=len(service.runs),
        n_workers=service.n_workers,
        trainings=trainings,
        machines=tuple(machines(service, trainings)),
        step=0 if run is None else run.step,
        n_steps=0 if run is None else run.n_steps,
        progress=done if step is None else step.step / max(step.n_steps, 1),
        stage=stage,
        stage_number=number,
        n_stages=n_stages,
        message="" if run is None else run.message,
        steps_per_s=step.steps_per_s if step is not None and state == "running" else 0.0,
        eta_s=None if run is None else run.eta_s,
        curve_clip_index=curve_clip,
        gradient_norm=step.gradient_norm if step is not None and math.isfinite(step.gradient_norm) else None,
        loss_history=() if curves is None else curves.loss,
        psnr_history=() if curves is None else curves.psnr,
        can_train_next=service.can_train_next,
        next_clip_index=upcoming,
        resume_step=None if upcoming is None else service.catalog[upcoming].resume_step,
        queue=tuple(service.queue),
    )


def running_clips(service: TrainingService) -> tuple[RunningClip, ...]:
    """All clips in training, here and elsewhere, in the order of their indices."""
    runs = [run for run in service.runs.values() if run.ending is None]
    found = [_running(run.progress, worker=run.worker_number) for run in runs]
    found += [_elsewhere(clip_index, other) for clip_index, other in service.elsewhere.items()]
    return tuple(sorted(found, key=lambda clip: clip.clip_index))


def _running(progress: ClipProgress, **known: Any) -> RunningClip:
    said = asdict(progress)
    del said["load"]  # see `machines`
    return RunningClip(**(said | known))


def _elsewhere(clip_index: int, other: Elsewhere) -> RunningClip:
    said = other.progress or ClipProgress(clip_index, "unknown")
    machine = said.machine or ("" if other.holder is None else other.holder.owner.host)
    return _running(said, clip_index=clip_index, machine=machine, is_elsewhere=True, who=other.who)


def machines(service: TrainingService, trainings: Sequence[RunningClip]) -> list[MachineStatus]:
    """The computers that train these clips, this one first, the others by name."""
    here, known = machine_name(), dict[str, MachineLoad]()
    for holder in service.claims.others:
        known[holder.owner.host] = holder.load
    known |= {clip.machine: clip.load for clip in service.progress.values() if clip.load is not None}
    known[here] = service.claims.load
    counts = Counter(clip.machine or here for clip in trainings)
    found = list[MachineStatus]()
    for name in sorted({*counts, here}, key=lambda name: (name != here, name)):
        load = known.get(name, MachineLoad(0))
        found.append(MachineStatus(name, name == here, counts[name], load.n_cores, load.load, load.free_mb))
    return found


def curves_of(service: TrainingService, clip_index: int) -> Curves | None:
    """Those of the running training once it has any; otherwise those on disk, None until they are read."""
    run, last = service.runs.get(clip_index), service.last
    if run is None and last is not None and last.clip_index == clip_index and isinstance(last.ending, ClipTrained):
        run = last
    if run is not None and (run.curves.loss or run.curves.psnr):
        return run.curves
    state, project = service.catalog[clip_index].state, service.project
    return service.curves.curves(project.curve_path(clip_index, is_finished=state not in ("stopped", "untrained")))


class ClipStatuses:
    """One status per clip of a project. Only what has changed is remade: they are asked for at every change of the
    picture, and clips may be thousands."""

    def __init__(self, service: TrainingService) -> None:
        self._service = service
        self._statuses: list[ClipStatus] = []
        self._made_of: tuple[object, ...] = ()
        self._records: list[ClipRecord] = []
        self._places: set[tuple[str, int, str]] = set()

    def all(self, live_counts: tuple[int, int, int] | None = None) -> list[ClipStatus]:
        """All of them.

        Args:
            live_counts: A clip that trains, with its inherited and own anchors, if a state of it was loaded.
        """
        self._follow()
        for clip_index in (*self._service.runs, *self._service.elsewhere):
            counts = live_counts[1:] if live_counts is not None and live_counts[0] == clip_index else None
            self._statuses[clip_index] = self._status(clip_index, counts)
        return list(self._statuses)

    def _follow(self) -> None:
        """Remake those that have changed, but for those that train."""
        service = self._service
        queue, runs, catalog, elsewhere = service.queue, service.runs, service.catalog, service.elsewhere
        made_of = (catalog.revision, queue.revision, tuple(runs), tuple(queue.failed.items()), tuple(elsewhere))
        if self._made_of == made_of:
            return
        places = {("waits", index, "") for index in queue} | {("trains", index, "") for index in runs}
        places |= {("elsewhere", index, "") for index in elsewhere}
        places |= {("failed", index, why) for index, why in queue.failed.items()}
        if len(self._statuses) != len(catalog):
            self._statuses = [self._status(index, None) for index in range(len(catalog))]
        else:
            changed = {index for _, index, _ in places ^ self._places}
            pairs = zip(catalog.records, self._records, strict=True)
            changed.update(index for index, (now, then) in enumerate(pairs) if now is not then)
            for index in changed:
                self._statuses[index] = self._status(index, None)
        self._made_of, self._records, self._places = made_of, list(catalog.records), places

    def _status(self, clip_index: int, live_counts: tuple[int, int] | None) -> ClipStatus:
        record, run, queue = self._service.catalog[clip_index], self._service.runs.get(clip_index), self._service.queue
        n_inherited, n_own = record.n_anchors if live_counts is None else live_counts
        shown, step, n_steps, reason = record.state, record.step, record.n_steps, record.reason
        psnr, is_whole = record.held_out_psnr, record.held_out_whole
        if run is not None:
            shown, step, n_steps = _WORDS.get(run.state, "training"), run.step, run.n_steps
            if run.held_out_psnr is not None:
                psnr, is_whole = run.held_out_psnr, False
        elif (other := self._service.elsewhere.get(clip_index)) is not None:
            said = other.progress
            shown = "training" if said is None else _WORDS.get(said.state, "training")
            step, n_steps = (0, 0) if said is None else (said.step, said.n_steps)
            psnr, is_whole = (None if said is None else said.held_out_psnr), False
        elif clip_index in queue:
            shown = "queued"
        elif clip_index in queue.failed and shown in ("untrained", "stopped"):
            shown, reason = "failed", queue.failed[clip_index]
        share = step / n_steps if n_steps else 0.0
        return ClipStatus(
            state=shown,
            progress=1.0 if shown == "trained" else min(share, 1.0),
            held_out_psnr=psnr,
            n_inherited=n_inherited,
            n_own=n_own,
            resume_step=record.resume_step,
            reason=reason,
            exposure_change=record.exposure_change,
            held_out_whole=is_whole,
        )
