"""TrainingPlan: what is known of a clip's training before it begins, each number with its reason, and a forecast.

Numbers of steps and pictures are exact. Of anchors, which follow from the pictures, a plan knows limits. The forecast
is that of engine.training.plan.forecast. No clock, no files.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.clip_files.clip_header import ClipHeader
from engine.errors import PreparationError
from engine.training.config import JOINT_RULE, SOURCE_RULE, STATIC_RULE, StepRule, TrainConfig
from engine.training.phases import phases_of
from engine.training.plan.forecast import (
    Expected,
    MeasuredClip,
    expected_from,
    expected_training,
    rough_memory_mb,
    rough_preparation_s,
)

Value = int | float | str | None

_STATIC_PER_PIXEL, _ALIVE_PER_PIXEL = 0.19, 0.035
"""Anchors per pixel of one picture where nothing better is known: static ones, and moving ones alive in a frame."""
SEEN_SHARE = 0.6
"""Of the static anchors, those that one camera sees."""


@dataclass(frozen=True, slots=True)
class StepSizes:
    """What the time of a training step follows from.

    Attributes:
        width, height: Of a picture, pixels.
        n_static, n_moving: Anchors that a camera sees at one time.
        config: Widths, Gaussians per anchor, loss.
    """

    width: int
    height: int
    n_static: int
    n_moving: int
    config: TrainConfig


@dataclass(frozen=True, slots=True)
class PlanLine:
    """One number of a plan.

    Attributes:
        name: As shown to the user.
        value: Number or words; None where nobody can know yet.
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
        if shown is None:
            return "unknown"
        if isinstance(shown, float):
            shown = f"{shown:,.0f}" if abs(shown) >= 100 else f"{shown:.2g}" if abs(shown) < 1 else f"{shown:.1f}"
        elif isinstance(shown, int):
            shown = f"{shown:,}"
        return f"{shown} {self.unit}".rstrip()


@dataclass(frozen=True, slots=True)
class ForecastLine(PlanLine):
    """A line of the forecast: its value is a number, or None."""

    value: float | None


@dataclass(frozen=True, slots=True)
class TrainingPlan:
    """What a training is going to do and what it is expected to take. A value.

    Attributes:
        clip_index, start, n_frames: The clip.
        role: "reference" or "source".
        n_steps: Of all phases.
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
    def seconds(self) -> float | None:
        """Forecast of the wall time; None where it is not known."""
        if self.preparation_s.value is None or self.training_s.value is None:
            return None
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
        training_s=replace(
            training_s,
            value=None if training_s.value is None else training_s.value * left,
            reason=f"{training_s.reason}; {done}",
        ),
    )


@dataclass(frozen=True, slots=True)
class Footage:
    """What there is to train on.

    Attributes:
        width, height: Working size, pixels.
        n_cameras, n_held_out: Cameras to train on, and those left out.
        n_frames: Of the capture.
    """

    width: int
    height: int
    n_cameras: int
    n_held_out: int
    n_frames: int

    @property
    def n_pixels(self) -> int:
        """Of one picture."""
        return self.width * self.height


def footage_of(capture: Capture, holdout: Sequence[int]) -> Footage:
    """Numbers of a capture.

    Raises:
        PreparationError: Cameras differ in size, or fewer than two are left for training.
    """
    n_cameras = len(capture.training_cameras(holdout))
    if n_cameras < 2:
        raise PreparationError(
            f"Only {n_cameras} of {len(capture.rig)} cameras are left for training; two are needed.",
            hint="Hold out fewer cameras, or exclude fewer.",
            path=capture.path,
        )
    width, height = capture.picture_size
    n_held_out = len(set(holdout) - set(capture.excluded_cameras))
    return Footage(width, height, n_cameras, n_held_out, capture.n_frames)


StepTime = Callable[[StepSizes, str], float | None]
"""Seconds of a step of these sizes in a phase, see engine.training.plan.measured_steps; None without one."""


def make_plan(
    footage: Footage,
    clip: Clip,
    config: TrainConfig,
    *,
    is_source: bool,
    reference: ClipHeader | None = None,
    history: Sequence[MeasuredClip] = (),
    step_time: StepTime = lambda sizes, phase: None,
    is_still: bool = False,
    exposure: tuple[float, float] | None = None,
) -> TrainingPlan:
    """The plan of one clip.

    Args:
        footage: What there is to train on.
        clip: Which frames.
        config: All settings.
        is_source: Whether the clip begins with what another one has learned, and so has one phase instead of two.
        reference: Header of that other clip; None where it is not trained yet.
        history: Trained clips of the project, in any order; this one, when it is trained again, does not count.
        step_time: Asked where no clip of the same kind was measured.
        is_still: Whether nothing moves in this clip, by `engine.training.plan.stillness.looks_still`.
        exposure: Against the reference clip's, see `engine.training.plan.exposure_span`; None where it is not known.
    """
    same = [known for known in history if known.clip_index != clip.clip_index and known.is_source == is_source]
    same = [known for known in same if not known.is_still]
    phases = _phase_lines(footage, clip, config, is_source=is_source)
    if is_still and is_source:
        nothing = "nothing moves in the sampled pictures, so there is nothing to learn"
        phases = [replace(line, value=0, reason=nothing) for line in phases]
    steps = {line.name.removesuffix(" steps"): int(line.value or 0) for line in phases}
    n_static, n_moving = expected_anchors(footage, config, reference)
    sizes = StepSizes(footage.width, footage.height, round(SEEN_SHARE * n_static), n_moving, config)
    n_pictures = footage.n_cameras * clip.n_frames
    n_read = n_pictures
    if not is_source and config.needs_backgrounds and config.backgrounds == "capture":
        n_read = footage.n_cameras * min(footage.n_frames, config.background_frames)
    preparation = expected_from(same, "preparation_s") or Expected(
        rough_preparation_s(
            n_cameras=footage.n_cameras,
            n_pictures=n_pictures,
            is_source=is_source,
            is_by_frame=config.cloud == "frames",
        ),
        "rough",
    )
    training = expected_training(same, steps, lambda phase: step_time(sizes, phase))
    memory = expected_from(same, "memory_mb") or Expected(
        rough_memory_mb(n_pixels=footage.n_pixels, n_pictures=n_pictures, n_read=n_read), "the program and its pictures"
    )
    disk = expected_from(same, "disk_mb") or Expected(None, "not known before a clip of this kind is trained")
    if is_still and is_source:
        disk = Expected(None, "negligible")
    return TrainingPlan(
        clip_index=clip.clip_index,
        start=clip.start,
        n_frames=clip.n_frames,
        role="source" if is_source else "reference",
        n_steps=sum(steps.values()),
        lines=(
            *_picture_lines(footage, clip, config, is_source=is_source),
            *phases,
            *_anchor_lines(config, reference, is_source=is_source),
            *_distance_lines(clip, reference, exposure),
            PlanLine("Gaussians per anchor", config.gaussians_per_anchor, "", "as in every clip of the project"),
        ),
        preparation_s=_forecast_line("preparation", "s", preparation),
        training_s=_forecast_line("training", "s", training),
        memory_mb=_forecast_line("memory", "MB", memory),
        disk_mb=_forecast_line("stored clip", "MB", disk),
    )


def _forecast_line(name: str, unit: str, expected: Expected) -> ForecastLine:
    return ForecastLine(name, None if expected.value is None else round(expected.value, 3), unit, expected.reason)


def expected_anchors(footage: Footage, config: TrainConfig, reference: ClipHeader | None) -> tuple[int, int]:
    """Static anchors, and moving ones alive in one frame: the reference clip's, or as many as pictures suggest."""
    n_static = min(round(_STATIC_PER_PIXEL * footage.n_pixels), config.max_static_points)
    n_alive = min(round(_ALIVE_PER_PIXEL * footage.n_pixels), config.max_moving_points)
    if reference is None:
        return n_static, n_alive
    return reference.n_anchors.get("static", n_static), n_alive if reference.n_alive is None else reference.n_alive


# ---------------------------------------------------------------- lines


def _picture_lines(footage: Footage, clip: Clip, config: TrainConfig, *, is_source: bool) -> list[PlanLine]:
    left_out = f"{footage.n_held_out} held out" if footage.n_held_out else "none held out"
    n_pictures = footage.n_cameras * clip.n_frames
    counted = f"{footage.n_cameras} cameras ({left_out}) x {_plural(clip.n_frames, 'frame')}"
    lines = [PlanLine("pictures", n_pictures, "", f"{counted}, {footage.width}x{footage.height}")]
    if not is_source and config.needs_backgrounds:
        whose, n_all = "the clip", clip.n_frames
        if config.backgrounds == "capture":
            whose, n_all = "the capture", footage.n_frames
        n_frames = min(n_all, config.background_frames)
        spread = f"all of {whose}" if n_frames == n_all else f"spread over {whose}"
        lines.append(PlanLine("background frames", n_frames, "", f"of every camera, {spread}"))
    return lines


def _phase_lines(footage: Footage, clip: Clip, config: TrainConfig, *, is_source: bool) -> list[PlanLine]:
    """One line per phase; its value is the number of steps."""
    n_cameras, n_pictures = footage.n_cameras, footage.n_cameras * clip.n_frames
    if is_source:
        n_steps = config.n_source_steps(n_pictures)
        reason = _step_reason(config.source_steps, config.passes, SOURCE_RULE, n_pictures, "picture")
        return [PlanLine("source steps", n_steps, "", reason)]
    reasons = {
        "static": _step_reason(config.static_steps, 0.0, STATIC_RULE, n_cameras, "background"),
        "joint": _step_reason(config.joint_steps, config.passes, JOINT_RULE, n_pictures, "picture"),
    }
    phases = phases_of(config, n_cameras=n_cameras, n_frames=clip.n_frames, is_source=False)
    return [PlanLine(f"{name} steps", n_steps, "", reasons[name]) for name, n_steps in phases]


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


def _anchor_lines(config: TrainConfig, reference: ClipHeader | None, *, is_source: bool) -> list[PlanLine]:
    """Limits, and what a trained reference clip has; how many anchors a clip gets its pictures decide."""
    n_static, n_moving = f"<= {config.max_static_points:,}", f"<= {config.max_moving_points:,}"
    if config.cloud == "frames" and not is_source:
        n_most = f"<= {config.max_static_points + config.max_moving_points:,}"
        return [PlanLine("anchors", n_most, "", "of all frames; the voxel grows until there are no more")]
    if not is_source:
        grows = "the voxel grows until there are no more"
        return [PlanLine("static anchors", n_static, "", grows), PlanLine("moving anchors", n_moving, "", grows)]
    known = None if reference is None else reference.n_anchors.get("static")
    inherited = PlanLine("static anchors", n_static, "", "inherited; the reference clip is not trained yet")
    if known is not None:
        inherited = PlanLine("static anchors", known, "", "inherited, counted in the reference clip")
    if config.cloud == "frames":  # the limit is not below what a frame has: all of them
        return [inherited, PlanLine("residual anchors", None, "", "all points that inherited anchors do not cover")]
    return [inherited, PlanLine("residual anchors", n_moving, "", "together with the inherited moving ones in use")]


def _distance_lines(clip: Clip, reference: ClipHeader | None, exposure: tuple[float, float] | None) -> list[PlanLine]:
    """How far a source clip lies from its reference clip, in clips and in exposure."""
    lines = []
    if reference is not None:
        distance = abs(clip.clip_index - reference.clip_index)
        reason = f"from clip {reference.clip_index}, which it inherits from"
        lines.append(PlanLine("distance", distance, "clip" if distance == 1 else "clips", reason))
    if exposure is not None:
        low, high = (round(100 * share, 1) + 0.0 for share in exposure)
        shown = "unchanged" if low == high == 0 else f"{low:+.1f} to {high:+.1f} %"
        lines.append(PlanLine("exposure", shown, "", "against the reference clip, in the middle frame; removed"))
    return lines


def _plural(n: int, word: str) -> str:
    return f"{n:,} {word}{'' if n == 1 else 's'}"
