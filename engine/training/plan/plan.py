"""TrainingPlan: all that is known of a clip's training before it begins, each number with its reason, and a forecast.

Sizes that are fixed by settings or derived from the footage are exact. Those that follow from the clouds are expected,
and say so. Times come from `engine.training.plan.cost`, corrected by what earlier clips of the project took, or else
by how fast this machine computes a step of known size. No torch, no clock, no files.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from engine.capture.clip import Clip
from engine.clip_files.clip_header import ClipHeader
from engine.training.config import JOINT_RULE, SOURCE_RULE, STATIC_RULE, StepRule, TrainConfig
from engine.training.plan.cost import checkpoint_mb
from engine.training.plan.expected_sizes import Counts, Footage, clip_sizes, counts_of, expected_counts
from engine.training.plan.forecasting import UNKNOWN_MACHINE, MachineSpeed, MeasuredClip, forecast
from engine.training.step.early_stopping import MEASURE_EVERY, held_in_items

Value = int | float | str


@dataclass(frozen=True, slots=True)
class PlanLine:
    """One number of a plan.

    Attributes:
        name: As shown to the user.
        value: Number or word.
        unit: "" where there is none.
        reason: Where the value comes from, one clause.
    """

    name: str
    value: Value
    unit: str
    reason: str

    @property
    def text(self) -> str:
        """Value and unit as people read them."""
        shown = self.value
        if isinstance(shown, float):
            shown = f"{shown:,.0f}" if abs(shown) >= 100 else f"{shown:.2g}" if abs(shown) < 1 else f"{shown:.1f}"
        elif isinstance(shown, int):
            shown = f"{shown:,}"
        return f"{shown} {self.unit}".rstrip()


@dataclass(frozen=True, slots=True)
class ForecastLine(PlanLine):
    """A line of the forecast: its value is a number."""

    value: float


@dataclass(frozen=True, slots=True)
class TrainingPlan:
    """What a training is going to do and what it is expected to take. A value.

    Attributes:
        clip_index, start, n_frames: The clip.
        role: "reference" or "source".
        n_steps: Of all phases; early stopping may do with fewer.
        lines: Everything that is known, in the order in which it comes about.
        preparation_s, training_s: Forecast; together the wall time, compiling of kernels left out.
        memory_mb: Most that the training process will hold, 10^6 bytes.
        disk_mb: The finished clip, 10^6 bytes.
        steps_done: Of n_steps, where a training that was stopped goes on; the times are of what is left.
    """

    clip_index: int
    start: int
    n_frames: int
    role: str
    n_steps: int
    lines: tuple[PlanLine, ...]
    preparation_s: ForecastLine
    training_s: ForecastLine
    memory_mb: ForecastLine
    disk_mb: ForecastLine
    steps_done: int = 0

    @property
    def forecast(self) -> tuple[ForecastLine, ...]:
        """The four forecast lines."""
        return self.preparation_s, self.training_s, self.memory_mb, self.disk_mb

    @property
    def seconds(self) -> float:
        """Forecast of the wall time."""
        return self.preparation_s.value + self.training_s.value

    def line(self, name: str) -> PlanLine | None:
        """A line by its name, also one of the forecast; None where the plan has none."""
        return next((line for line in (*self.lines, *self.forecast) if line.name == name), None)

    def as_dict(self) -> dict[str, Any]:
        """JSON-able."""
        names = ("preparation_s", "training_s", "memory_mb", "disk_mb")
        return {
            "clip_index": self.clip_index,
            "start": self.start,
            "n_frames": self.n_frames,
            "role": self.role,
            "n_steps": self.n_steps,
            "steps_done": self.steps_done,
            "forecast": {name: line.value for name, line in zip(names, self.forecast, strict=True)},
            "lines": [asdict(line) for line in (*self.lines, *self.forecast)],
        }


def resumed_plan(plan: TrainingPlan, steps_done: int, n_steps: int) -> TrainingPlan:
    """The plan of a training that goes on after a stop.

    Args:
        plan: Of the whole training.
        steps_done, n_steps: As the checkpoint says; steps of the whole are not forecast any more.
    """
    left = 1.0 - steps_done / n_steps if n_steps else 0.0
    training_s, done = plan.training_s, f"{steps_done:,} of {n_steps:,} steps are done"
    return replace(
        plan,
        n_steps=n_steps,
        steps_done=steps_done,
        preparation_s=replace(plan.preparation_s, value=0.0, reason="done before the training was stopped"),
        training_s=replace(training_s, value=training_s.value * left, reason=f"{training_s.reason}; {done}"),
    )


def make_plan(
    footage: Footage,
    clip: Clip,
    config: TrainConfig,
    *,
    is_source: bool,
    reference: ClipHeader | None = None,
    history: Sequence[MeasuredClip] = (),
    machine: MachineSpeed = UNKNOWN_MACHINE,
    is_still: bool = False,
) -> TrainingPlan:
    """The plan of one clip.

    Args:
        footage: What there is to train on.
        clip: Which frames.
        config: All settings.
        is_source: Whether the clip begins with what another one has learned, and so has one phase instead of two.
        reference: Header of that other clip; None where it is not trained yet.
        history: Trained clips of the project, in any order; this one, when it is trained again, does not count.
        machine: What its speed is taken to be where no clip of the project was measured.
        is_still: Whether nothing moves in this clip, by `engine.training.plan.stillness.looks_still`.
    """
    history = [known for known in history if known.clip_index != clip.clip_index]
    # a clip in which nothing moved says nothing about one in which something may
    siblings = [
        known.counts for known in history if known.counts and known.counts.n_alive and known.is_source == is_source
    ]
    known = None if reference is None else counts_of(reference)
    counts = expected_counts(footage, clip, config, reference=known, siblings=siblings, is_source=is_source)
    if is_still:
        counts = Counts(counts.n_static, 0, 0, 0)
    phases = _phase_lines(footage, clip, config, is_source=is_source)
    if is_still and is_source:
        nothing = "nothing moves in the pictures looked at, so there is nothing to learn"
        phases = [replace(line, value=0, reason=nothing) for line in phases]
    sizes = clip_sizes(footage, clip, config, counts, is_source=is_source)
    lines = [
        *_picture_lines(footage, clip, config, is_source=is_source),
        *phases,
        _voxel_line(reference, is_source=is_source),
        *_anchor_lines(config, counts, known, n_siblings=len(siblings), is_source=is_source),
        *_model_lines(config, counts, is_source=is_source),
        PlanLine("kept while training", checkpoint_mb(sizes), "MB", "a checkpoint to go on from; it goes in the end"),
    ]
    if config.coarse_share and sum(int(line.value) for line in phases):
        n_coarse = sum(config.n_coarse_steps(int(line.value)) for line in phases)
        reason = f"the first {100 * config.coarse_share:.0f} % of every phase, as set"
        lines.append(PlanLine("half size", n_coarse, "steps", reason))
    if config.patience and sum(int(line.value) for line in phases):
        n_kept = len(held_in_items(footage.n_cameras, clip.n_frames, 0))
        reason = f"when {_plural(n_kept, 'picture')} kept out of training gain nothing over {config.patience} looks"
        lines.append(PlanLine("early stop", f"{MEASURE_EVERY * config.patience:,}", "steps", reason))
    steps = [int(line.value) for line in phases]
    expected = forecast(footage, clip, config, sizes, steps=steps, history=history, machine=machine)
    return TrainingPlan(
        clip_index=clip.clip_index,
        start=clip.start,
        n_frames=clip.n_frames,
        role="source" if is_source else "reference",
        n_steps=sum(steps),
        lines=tuple(lines),
        preparation_s=ForecastLine("preparation", *expected.preparation_s),
        training_s=ForecastLine("training", *expected.training_s),
        memory_mb=ForecastLine("memory", *expected.memory_mb),
        disk_mb=ForecastLine("stored clip", *expected.disk_mb),
    )


# ---------------------------------------------------------------- lines


def _picture_lines(footage: Footage, clip: Clip, config: TrainConfig, *, is_source: bool) -> list[PlanLine]:
    left_out = f"{footage.n_held_out} held out" if footage.n_held_out else "none held out"
    n_pictures = footage.n_cameras * clip.n_frames
    counted = f"{footage.n_cameras} cameras ({left_out}) x {_plural(clip.n_frames, 'frame')}"
    lines = [PlanLine("pictures", n_pictures, "", f"{counted}, {footage.width}x{footage.height}")]
    if not is_source:
        n_frames = min(footage.n_frames, config.background_frames)
        spread = "all there are" if n_frames == footage.n_frames else "spread over the capture"
        lines.append(PlanLine("background frames", n_frames, "", f"of every camera, {spread}"))
    return lines


def _phase_lines(footage: Footage, clip: Clip, config: TrainConfig, *, is_source: bool) -> list[PlanLine]:
    """One line per phase; its value is the number of steps."""
    n_cameras, n_pictures = footage.n_cameras, footage.n_cameras * clip.n_frames
    if is_source:
        n_steps = config.n_source_steps(n_pictures)
        reason = _step_reason(config.source_steps, config.passes, SOURCE_RULE, n_pictures, "picture")
        return [PlanLine("source steps", n_steps, "", reason)]
    return [
        PlanLine(
            "static steps",
            config.n_static_steps(n_cameras),
            "",
            _step_reason(config.static_steps, 0.0, STATIC_RULE, n_cameras, "background"),
        ),
        PlanLine(
            "joint steps",
            config.n_joint_steps(n_pictures),
            "",
            _step_reason(config.joint_steps, config.passes, JOINT_RULE, n_pictures, "picture"),
        ),
    ]


def _step_reason(given: int, passes: float, rule: StepRule, n_items: int, item: str) -> str:
    if given:
        return "as set"
    if passes:
        return f"{passes:g} passes over {_plural(n_items, item)}, as set"
    asked = rule.per_item * n_items
    bound = ""
    if asked < rule.lowest:
        bound = f", at least {rule.lowest:,}"
    elif asked > rule.highest:
        bound = f", at most {rule.highest:,}"
    return f"{rule.per_item} for each of {_plural(n_items, item)}{bound}"


def _voxel_line(reference: ClipHeader | None, *, is_source: bool) -> PlanLine:
    """The grid on which what moves is carved."""
    known = None if reference is None else reference.moving_spacing
    if is_source and isinstance(known, int | float):
        return PlanLine("voxel", float(known), "units", "the reference clip's: the same place gives the same anchors")
    if is_source:
        return PlanLine("voxel", "inherited", "", "the reference clip's: the same place gives the same anchors")
    return PlanLine(
        "voxel", "derived", "", "as fine as pixels are at that distance, coarser where the limits below ask"
    )


def _anchor_lines(
    config: TrainConfig, counts: Counts, reference: Counts | None, *, n_siblings: int, is_source: bool
) -> list[PlanLine]:
    past = f"expected, the middle of {_plural(n_siblings, 'clip')} trained before"
    limit = f"at most {config.max_moving_points:,} with the inherited ones in use"
    if not is_source:
        static = f"expected; the voxel grows until there are at most {config.max_static_points:,}"
        moving = f"expected; the voxel grows until there are at most {config.max_moving_points:,}"
        return [
            PlanLine("static anchors", counts.n_static, "", past if n_siblings else static),
            PlanLine("moving anchors", counts.n_moving, "", past if n_siblings else moving),
        ]
    words = {
        "frozen": "kept as they are",
        "moving": "kept as they are",
        "trainable": "they go on learning",
        "off": "left out, the clip has its own",
    }
    known = "counted in the reference clip" if reference else "expected, the reference clip is not trained yet"
    residual = {
        "dedup": f"expected; those that inherited anchors do not cover, {limit}",
        "none": "residual=none",
        "full": "expected; all that moves, residual=full",
    }[config.residual]
    if not counts.n_alive:
        residual = "nothing moves"
    elif n_siblings:
        residual = f"{past}; {limit}" if config.residual == "dedup" else past
    if counts.n_alive and config.inherit == "moving":
        residual += ", and inherited ones that go on learning"
    return [
        PlanLine("static anchors", counts.n_static, "", f"{words[config.inherit]}; {known}"),
        PlanLine("residual anchors", counts.n_moving, "", residual),
    ]


def _model_lines(config: TrainConfig, counts: Counts, *, is_source: bool) -> list[PlanLine]:
    default, inherited = TrainConfig(), "the reference clip's" if is_source and config.decoder != "new" else ""
    widths = f"{config.static_feature_dim} + {config.dynamic_feature_dim}"
    lines = [
        PlanLine(
            "Gaussians per anchor",
            config.gaussians_per_anchor,
            "",
            inherited
            or _set_or(config, default, "gaussians_per_anchor", "enough where anchors are 2 to 3 pixels apart"),
        ),
        PlanLine(
            "features",
            widths,
            "",
            inherited or _set_or(config, default, "static_feature_dim", "static and dynamic, the small preset"),
        ),
    ]
    if not counts.n_table_values:
        return [*lines, PlanLine("field", "none", "", "nothing moves")]
    entries = f"2^{config.field_log2_entries} entries, as set"
    if not config.field_log2_entries:
        entries = f"entries follow from {counts.n_alive:,} anchors alive in a frame"
    n_levels = config.field_levels or config.field_max_levels
    levels = "as set" if config.field_levels else "until a cell is 1.5 anchor spacings"
    lines.append(PlanLine("field levels", n_levels, "", f"at most, {levels}" if levels != "as set" else levels))
    lines.append(PlanLine("field table values", counts.n_table_values, "", f"at most; {entries}"))
    if is_source:
        reason = "only tiles that something learning touches" if config.tiles == "active" else "whole pictures, as set"
        lines.append(PlanLine("tiles", config.tiles, "", reason))
    return lines


def _set_or(config: TrainConfig, default: TrainConfig, name: str, reason: str) -> str:
    return "as set" if getattr(config, name) != getattr(default, name) else reason


def _plural(n: int, word: str) -> str:
    return f"{n:,} {word}{'' if n == 1 else 's'}"
