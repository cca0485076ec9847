"""Plans of a project's clips, from the settings, the capture and the clips trained before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from app.background.kernels import COMPILING
from app.plan.sequence import SequencePlan
from app.project.clips.clip_catalog import ClipCatalog
from app.project.project import Project
from app.status import PlanStatus, SettingStatus
from app.training.own_settings import derived_steps
from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.text import duration_text, figure_text
from engine.training.config import SETTINGS, TrainConfig
from engine.training.plan.forecast import MeasuredClip, measured_clip
from engine.training.plan.plan import PlanLine, StepTime, TrainingPlan, footage_of, make_plan, resumed_plan
from engine.training.presets import PRESETS, closest_preset

PLAN_SCHEMA = 3


MAX_MEASURED = 200
"""Finished clips that say what the next one costs, spread over all: more would not change a median."""


def clip_history(project: Project, n_clips: int, catalog: ClipCatalog | None = None) -> list[MeasuredClip]:
    """Measurements of a project's finished clips, for planning the next one.

    Args:
        catalog: Says which clips are finished; all files are looked for when None.
    """
    finished = range(n_clips) if catalog is None else catalog.finished
    if catalog is not None and len(finished) > MAX_MEASURED:
        reference = {project.settings.reference_clip}.intersection(finished)
        finished = sorted({*finished[:: -(-len(finished) // MAX_MEASURED)], *reference})
    found = (_measured(project, clip_index) for clip_index in finished)
    return [known for known in found if known is not None]


def plan_clip(
    project: Project,
    capture: Capture,
    clip: Clip,
    *,
    step_time: StepTime,
    history: Sequence[MeasuredClip] | None = None,
    catalog: ClipCatalog | None = None,
    is_afresh: bool = False,
) -> TrainingPlan:
    """The plan of one clip of a project.

    Args:
        project: Its folder need not exist yet.
        capture: At the project's scale.
        clip: One of its clips.
        step_time: Asked where no other clip of this kind says how long training takes.
        history: Of all its clips, for callers that plan many; read here when None.
        catalog: Says whether the training was stopped and continues; when None, the whole of it is planned.
        is_afresh: Plan as if nothing were trained yet.
    Raises:
        CaptureError, PreparationError: The capture does not fit the settings.
    """
    settings, config = project.settings, project.settings.config()
    capture = capture.without(project.document.exclusions)
    base = project.inherited_index(clip.clip_index)
    if base is None and config.start == "previous" and clip.clip_index != settings.reference_clip:
        base, config = project.previous_index(clip.clip_index), config.going_on()
    if is_afresh:
        history, catalog = (), None
    elif history is None:
        history = clip_history(project, len(project.clips(capture.n_frames)), catalog)
    found = None if base is None or is_afresh else project.headers.read(project.clip_path(base))
    plan = make_plan(
        footage_of(capture, capture.camera_indices(settings.holdout)),
        clip,
        config,
        is_source=base is not None,
        reference=None if found is None else found.header,
        history=history,
        step_time=step_time,
        is_still=base is not None and _looks_still(project, capture, clip, config),
        exposure=None if base is None else _exposure_span(project, capture, clip, config),
    )
    record = None if catalog is None else catalog[clip.clip_index]
    if record is None or record.resume_step is None:
        return plan
    return resumed_plan(plan, record.resume_step, record.resume_n_steps)


def _looks_still(project: Project, capture: Capture, clip: Clip, config: TrainConfig) -> bool:
    from engine.training.plan.stillness import (
        looks_still,  # with numba, which the first picture of a window can wait for
    )

    if project.document.regions:  # a region may make something move that no mask shows
        return False
    held_out = capture.camera_indices(project.settings.holdout)
    return looks_still(capture, clip, capture.training_cameras(held_out), config, project.prep_dir)


def _exposure_span(project: Project, capture: Capture, clip: Clip, config: TrainConfig) -> tuple[float, float] | None:
    from engine.training.plan.exposure_span import exposure_span  # with numba, like the above

    held_out = capture.camera_indices(project.settings.holdout)
    return exposure_span(capture, clip, capture.training_cameras(held_out), config, project.prep_dir)


def sum_known(values: Sequence[float | None]) -> float | None:
    """Of all values; None where one is not known."""
    known = [value for value in values if value is not None]
    return sum(known) if len(known) == len(values) else None


def _measured(project: Project, clip_index: int) -> MeasuredClip | None:
    found = project.headers.read(project.clip_path(clip_index))
    if found is None or found.header is None:
        return None
    compiling_s = found.header.figures.stages_s.get(COMPILING, 0.0)
    known = measured_clip(found.header, disk_mb=found.n_bytes / 1e6, uncounted_s=compiling_s)
    return replace(known, clip_index=clip_index)  # a file keeps its number when clips before it are split or merged


# ---------------------------------------------------------------- for the window


def plan_status(
    project: Project, capture: Capture, clip: Clip, plan: TrainingPlan | None, *, can_edit: bool, discards: str
) -> PlanStatus:
    """The next clip's plan as the window shows it.

    Args:
        project, capture, clip: Those to be trained.
        plan: Its plan; None until it is made.
        can_edit: Whether settings may still change.
        discards: The progress that a change would discard, in words.
    """
    settings, config = project.settings, project.settings.config()
    capture = capture.without(project.document.exclusions)
    n_cameras = len(capture.training_cameras(capture.camera_indices(settings.holdout)))
    derived = derived_steps(config, n_cameras, clip.n_frames, capture.picture_size)
    lines = () if plan is None else (*plan.lines, *plan.forecast)
    return PlanStatus(
        clip_index=clip.clip_index,
        summary="" if plan is None else short_text(plan),
        lines=tuple((line.name, line.text) for line in lines),
        presets=tuple(PRESETS),
        preset=closest_preset(settings.overrides),
        settings=tuple(
            SettingStatus(
                setting.name,
                setting.label,
                int(derived.get(setting.name) or getattr(config, setting.name)),
                setting.name in settings.overrides,
                f"{setting.meaning}\n{setting.span}",
            )
            for setting in SETTINGS.values()
            if setting.label
        ),
        can_edit=can_edit,
        discards=discards,
    )


# ---------------------------------------------------------------- as text and JSON


def memory_text(memory_mb: float | None) -> str:
    """Memory as part of a sentence."""
    return f"{(memory_mb or 0.0) / 1e3:.1f} GB of memory"


def short_text(plan: TrainingPlan) -> str:
    """The forecast as one line."""
    stored = "" if plan.disk_mb is None else f", {PlanLine('', plan.disk_mb, 'MB').text} stored"
    steps = f"{plan.n_steps:,} steps" if plan.n_steps else "no steps"
    times = f"{time_words(plan.seconds)} (preparation {duration_text(plan.preparation_s)})"
    if plan.steps_done:
        left = plan.n_steps - plan.steps_done
        steps = f"resumes at step {plan.steps_done:,}, {left:,} of {plan.n_steps:,} steps left"
        times = time_words(plan.seconds)
    return f"{steps}, {times}, {memory_text(plan.memory_mb)}{stored}"


def time_words(seconds: float | None) -> str:
    """A forecast of time as part of a sentence."""
    return "time not known yet" if seconds is None else f"about {duration_text(seconds)}"


def plan_text(plan: TrainingPlan) -> list[str]:
    """Every line of a plan."""
    head = f"Clip {plan.clip_index}, frames {plan.start} to {plan.start + plan.n_frames - 1}, {plan.role}"
    return [head, *(f"  {line.name:<21} {line.text:>11}" for line in (*plan.lines, *plan.forecast))]


def begin_text(plan: TrainingPlan) -> list[str]:
    """The two lines that a training begins with."""
    counts = ", ".join(f"{line.text} {line.name}" for line in plan.lines if line.name.endswith(("steps", "anchors")))
    return [f"Clip {plan.clip_index}: {short_text(plan)}", f"  {counts}"]


def compared_text(plan: TrainingPlan, project: Project) -> str:
    """The forecast of a clip that is trained now, against what it took; empty where nothing was recorded."""
    taken = _measured(project, plan.clip_index)
    if taken is None:
        return ""
    pairs = (
        ("preparation", plan.preparation_s, taken.preparation_s, "s"),
        ("training", plan.training_s, taken.training_s, "s"),
        ("memory", plan.memory_mb, taken.memory_mb, "MB"),
        ("stored", plan.disk_mb, taken.disk_mb, "MB"),
    )
    parts = [
        f"{name} {figure_text(expected)} against {figure_text(measured)} {unit}"
        for name, expected, measured, unit in pairs
        if measured is not None and expected is not None
    ]
    return f"  Forecast against measured: {', '.join(parts)}" if parts else ""


def plan_document(
    project: Project,
    capture: Capture,
    plans: Sequence[TrainingPlan],
    trained: Sequence[int],
    damaged: Sequence[int] = (),
    sequence: SequencePlan | None = None,
) -> dict[str, Any]:
    """The output of `train --plan --json`.

    Args:
        project, capture: As planned.
        plans: Of the clips that are not trained yet.
        trained: Indices of chosen clips that are.
        damaged: Indices of chosen clips that are not trained because they, or what they need, cannot be read.
        sequence: What all of it costs on several workers, if that was asked for.
    """
    rows = [plan.as_dict() | {"state": "planned"} for plan in plans]
    if sequence is not None:
        pairs = zip(rows, plans, strict=True)
        rows = [row | {"moved_mb": round(sequence.moved_mb[plan.clip_index], 4)} for row, plan in pairs]
    rows += [{"clip_index": clip_index, "state": "trained"} for clip_index in trained]
    rows += [{"clip_index": clip_index, "state": "damaged"} for clip_index in damaged]
    return {
        "schema": PLAN_SCHEMA,
        "project": str(project.folder),
        "capture": str(capture.path),
        "holdout": list(project.settings.holdout),
        "settings": project.settings.config().difference(),
        "clips": sorted(rows, key=lambda row: row["clip_index"]),
        "forecast": totals(plans),
        **({} if sequence is None else {"workers": sequence.as_dict()}),
    }


def totals(plans: Sequence[TrainingPlan]) -> dict[str, float | None]:
    """Of all planned clips: seconds and bytes add up, memory is that of the largest. None where one is not known."""
    return {
        "preparation_s": _sum([plan.preparation_s for plan in plans], 1),
        "training_s": _sum([plan.training_s for plan in plans], 1),
        "memory_mb": max((plan.memory_mb for plan in plans), default=0.0),
        "disk_mb": _sum([plan.disk_mb for plan in plans], 3),
    }


def _sum(values: Sequence[float | None], digits: int) -> float | None:
    total = sum_known(values)
    return None if total is None else round(total, digits)
