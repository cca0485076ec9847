"""TrainingPlan: the facts known of a clip's training before it begins, and a forecast of its time and memory.

Numbers of steps and pictures are exact. Of anchors, which follow from the pictures, a plan knows limits. The forecast
is the median of the project's own clips of the same kind; without one, timed steps times their number, rough
preparation and memory, and unknown bytes on disk. No clock, no files.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from msgspec.structs import replace as replace_settings

from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.clip_files.clip_header import ClipHeader
from engine.errors import PreparationError
from engine.parallel import n_cores
from engine.training.config import QUALITIES, TrainConfig
from engine.training.phases import phases_of
from engine.training.plan.forecast import MeasuredClip, median_of, rough_memory_mb, rough_preparation_s
from engine.training.windows import Windows

Value = int | float | str | None

_STATIC_PER_PIXEL, _ALIVE_PER_PIXEL = 0.19, 0.035
"""Anchors per pixel of one picture where nothing better is known: static ones, and moving ones alive in a frame."""
_KEEPING_SHARE = 0.03
"""Share of the steps' time that held-out figures, snapshots and checkpoints add."""
SEEN_SHARE = 0.6
"""Share of the static anchors that one camera sees."""


WINDOW_OVERLAP = 1.4
"""Anchors that the windows of a picture see together, against those that the picture sees."""


@dataclass(frozen=True, slots=True)
class StepSizes:
    """The quantities that the time of a training step follows from.

    Attributes:
        width, height: Of what a step draws, pixels.
        n_static, n_moving: Anchors that are seen there at one time.
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
        value: Number or words; None where not known yet.
        unit: "" where there is none.
    """

    name: str
    value: Value
    unit: str = ""

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
class TrainingPlan:
    """The plan of a training, with the time and memory it is expected to take. A value.

    Attributes:
        clip_index, start, n_frames: The clip.
        role: "reference" or "source".
        n_steps: Of all phases.
        lines: The work ahead, in sentences.
        preparation_s, training_s: Forecast; together the wall time, compiling of kernels left out.
        memory_mb: Most that the training process will hold, 10^6 bytes.
        disk_mb: The finished clip, 10^6 bytes.
        steps_done: Of n_steps, where a stopped training resumes; the times are of the rest.
    """

    clip_index: int
    start: int
    n_frames: int
    role: str
    n_steps: int
    lines: tuple[PlanLine, ...]
    preparation_s: float
    training_s: float | None
    memory_mb: float
    disk_mb: float | None
    steps_done: int = 0

    @property
    def forecast(self) -> tuple[PlanLine, ...]:
        """The four forecast figures."""
        return (
            PlanLine("preparation", self.preparation_s, "s"),
            PlanLine("training", self.training_s, "s"),
            PlanLine("memory", self.memory_mb, "MB"),
            PlanLine("stored clip", self.disk_mb, "MB"),
        )

    @property
    def seconds(self) -> float | None:
        """Forecast of the wall time; None where it is not known."""
        return None if self.training_s is None else self.preparation_s + self.training_s

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
            "forecast": {name: getattr(self, name) for name in names},
            "lines": [asdict(line) for line in (*self.lines, *self.forecast)],
        }


def resumed_plan(plan: TrainingPlan, steps_done: int, n_steps: int) -> TrainingPlan:
    """The plan of a training that resumes after a stop.

    Args:
        plan: Of the whole training.
        steps_done, n_steps: As the checkpoint says; steps of the whole are no longer forecast.
    """
    left = 1.0 - steps_done / n_steps if n_steps else 0.0
    training_s = None if plan.training_s is None else plan.training_s * left
    return replace(plan, n_steps=n_steps, steps_done=steps_done, preparation_s=0.0, training_s=training_s)


@dataclass(frozen=True, slots=True)
class Footage:
    """The footage to train on.

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
        """Pixels of one picture."""
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
        footage: The footage to train on.
        clip: Which frames.
        config: All settings.
        is_source: Whether the clip starts from another trained clip, and so has one phase instead of two.
        reference: Header of that other clip; None where it is not trained yet.
        history: Trained clips of the project, in any order; this one, when it is trained again, does not count.
        step_time: Asked where no clip of the same kind was measured.
        is_still: Whether nothing moves in this clip, by `engine.training.plan.stillness.looks_still`.
        exposure: Against the reference clip's, see `engine.training.plan.exposure_span`; None where it is not known.
    """
    same = [
        known
        for known in history
        if known.clip_index != clip.clip_index and known.is_source == is_source and not known.is_still
    ]
    windows = Windows(footage.width, footage.height)
    counts = {"n_cameras": footage.n_cameras, "n_frames": clip.n_frames, "n_windows": len(windows)}
    others = {
        quality: sum(n for _, n in phases_of(replace_settings(config, quality=quality), **counts, is_source=is_source))
        for quality in QUALITIES
        if quality != config.quality
    }
    config = config.of_windows(len(windows))
    phases = phases_of(config, **counts, is_source=is_source)
    stays_still = is_still and is_source
    if stays_still:
        phases = [(name, 0) for name, _ in phases]
    n_steps = sum(n for _, n in phases)
    n_pictures = footage.n_cameras * clip.n_frames
    n_read = n_pictures
    if not is_source and config.needs_backgrounds and config.backgrounds == "capture":
        n_read = footage.n_cameras * min(footage.n_frames, config.background_frames)
    n_static, n_moving = expected_anchors(footage, config, reference)
    share = 1.0 if len(windows) == 1 else min(1.0, WINDOW_OVERLAP / len(windows))
    window, n_seen, n_alive = windows[0], round(share * SEEN_SHARE * n_static), round(share * n_moving)
    sizes = StepSizes(window.width, window.height, n_seen, n_alive, config)
    step_s = median_of([known.step_s for known in same])
    timed_s = _timed_s(phases, lambda phase: step_time(sizes, phase)) if step_s is None else step_s * n_steps
    preparation_s = median_of([known.preparation_s for known in same]) or rough_preparation_s(
        n_cameras=footage.n_cameras,
        n_pictures=n_read,
        is_source=is_source,
        n_cores=n_cores(),
        is_by_frame=config.cloud == "frames",
    )
    memory_mb = median_of([known.memory_mb for known in same]) or rough_memory_mb(
        (footage.n_cameras, clip.n_frames, footage.height, footage.width), n_read=n_read
    )
    disk_mb = None if stays_still else median_of([known.disk_mb for known in same])
    return TrainingPlan(
        clip_index=clip.clip_index,
        start=clip.start,
        n_frames=clip.n_frames,
        role="source" if is_source else "reference",
        n_steps=n_steps,
        lines=(
            *_picture_lines(footage, clip, config, is_source=is_source),
            *(PlanLine(f"{name} steps", n) for name, n in phases),
            *_anchor_lines(config, reference, is_source=is_source),
            *_distance_lines(clip, reference, exposure),
            PlanLine("Gaussians per anchor", config.gaussians_per_anchor),
            *(
                PlanLine(f"training at quality={quality}", None if timed_s is None else timed_s * n / n_steps, "s")
                for quality, n in others.items()
                if n_steps and n != n_steps  # lengths that are set follow no quality
            ),
        ),
        preparation_s=round(preparation_s, 3),
        training_s=None if timed_s is None else round(timed_s, 3),
        memory_mb=round(memory_mb, 3),
        disk_mb=None if disk_mb is None else round(disk_mb, 3),
    )


def _timed_s(phases: Sequence[tuple[str, int]], step_s: Callable[[str], float | None]) -> float | None:
    """Seconds of all steps, from the timed step of each phase; None where one could not be timed."""
    total_s = 0.0
    for phase, n_steps in phases:
        if n_steps:
            timed_s = step_s(phase)
            if timed_s is None:
                return None
            total_s += n_steps * timed_s * (1 + _KEEPING_SHARE)
    return total_s


def expected_anchors(footage: Footage, config: TrainConfig, reference: ClipHeader | None) -> tuple[int, int]:
    """Static anchors, and moving ones alive in one frame: the reference clip's, or as many as pictures suggest."""
    n_static = min(round(_STATIC_PER_PIXEL * footage.n_pixels), config.max_static_points)
    n_alive = min(round(_ALIVE_PER_PIXEL * footage.n_pixels), config.max_moving_points)
    if reference is None:
        return n_static, n_alive
    return reference.n_anchors.get("static", n_static), n_alive if reference.n_alive is None else reference.n_alive


def _picture_lines(footage: Footage, clip: Clip, config: TrainConfig, *, is_source: bool) -> list[PlanLine]:
    lines = [PlanLine("pictures", footage.n_cameras * clip.n_frames)]
    if not is_source and config.needs_backgrounds:
        n_all = footage.n_frames if config.backgrounds == "capture" else clip.n_frames
        lines.append(PlanLine("background frames", min(n_all, config.background_frames)))
    return lines


def _anchor_lines(config: TrainConfig, reference: ClipHeader | None, *, is_source: bool) -> list[PlanLine]:
    """Limits, and the anchors of a trained reference clip; a clip's pictures decide how many it gets."""
    n_static, n_moving = f"<= {config.max_static_points:,}", f"<= {config.max_moving_points:,}"
    if config.cloud == "frames" and not is_source:
        return [PlanLine("anchors", f"<= {config.max_static_points + config.max_moving_points:,}")]
    if not is_source:
        return [PlanLine("static anchors", n_static), PlanLine("moving anchors", n_moving)]
    known = None if reference is None else reference.n_anchors.get("static")
    inherited = PlanLine("static anchors", n_static if known is None else known)
    # with a cloud of frames, all points that inherited anchors do not cover
    return [inherited, PlanLine("residual anchors", None if config.cloud == "frames" else n_moving)]


def _distance_lines(clip: Clip, reference: ClipHeader | None, exposure: tuple[float, float] | None) -> list[PlanLine]:
    """How far a source clip lies from its reference clip, in clips and in exposure."""
    lines = []
    if reference is not None:
        distance = abs(clip.clip_index - reference.clip_index)
        lines.append(PlanLine("distance", distance, "clip" if distance == 1 else "clips"))
    if exposure is not None:
        low, high = (round(100 * share, 1) + 0.0 for share in exposure)
        lines.append(PlanLine("exposure", "unchanged" if low == high == 0 else f"{low:+.1f} to {high:+.1f} %"))
    return lines
