"""The results of a benchmark: one row per operation and scene, with speed and error side by side. Plain values."""

from __future__ import annotations

from dataclasses import dataclass

from app.lab.bench.timing import Timing


@dataclass(frozen=True, slots=True)
class SpeedError:
    """One mark of the chart: a back end on a scene small enough for float64 brute force.

    Attributes:
        operation: "raster", "decode" or "step".
        scene: Name of the scene.
        size: The size of the computation, for people.
        backend: "cpu", or "reference" for plain torch in float32.
        total_ms: Forward and backward pass, median; of a step, all of it.
        value_error: Largest error of a value against float64, absolute (pixels: colours in 0..1).
        gradient_error: Largest relative error of a gradient against float64: |a - b| / |b| over each parameter.
    """

    operation: str
    scene: str
    size: str
    backend: str
    total_ms: float
    value_error: float
    gradient_error: float


@dataclass(frozen=True, slots=True)
class Trade:
    """One mark of the chart's lower rows: a setting that a user can change, with its time, size and error.

    Attributes:
        operation: "step", "clip" or "export".
        line: Marks of one line differ in one setting.
        setting: As it is written, or DEFAULTS.
        seconds: Of a training step, of the training of all clips without its preparation, or of writing a file.
        n_bytes: Of the clip files, or of the exported one.
        psnr_db: Of held-out pictures against the capture; of an exported file in the worst camera against the live
            picture.
        psnr_moving_db: Of moving pixels; None where there are none.
    """

    operation: str
    line: str
    setting: str
    seconds: float
    n_bytes: int
    psnr_db: float
    psnr_moving_db: float | None = None


DEFAULTS = "defaults"


@dataclass(frozen=True, slots=True)
class KernelRow:
    """Speed of our back end at full size, and its error and its lead over plain torch where both can be known.

    Attributes:
        operation, scene: As in SpeedError.
        size: The size of the computation, for people.
        forward, backward: At full size.
        checked_at: Size at which errors and ratio were found: the full one, or the recipe made small.
        value_error, gradient_error: As in SpeedError.
        reference_ratio: Time of plain torch in float32 over ours, forward and backward, in the same run.
        peak_mb: Memory one forward and backward pass adds to a process whose kernels are loaded; None if not measured.
        forward_pairs_per_s, backward_pairs_per_s: (pixel, Gaussian) evaluations in 4x4 blocks that some Gaussian
            reaches; None where there are no pixels.
    """

    operation: str
    scene: str
    size: str
    forward: Timing
    backward: Timing
    checked_at: str
    value_error: float
    gradient_error: float
    reference_ratio: float
    peak_mb: float | None = None
    forward_pairs_per_s: float | None = None
    backward_pairs_per_s: float | None = None


def kernel_row(
    marks: dict[str, SpeedError],
    timings: tuple[Timing, Timing],
    *,
    size: str,
    peak_mb: float | None,
    pairs: int | None = None,
) -> KernelRow:
    """The row of a scene from the marks of both back ends.

    Args:
        marks: "cpu" and "reference".
        timings: Of our back end at full size, forward and backward.
        size: The size of the computation, for people.
        peak_mb: See KernelRow.
        pairs: (pixel, Gaussian) evaluations of one pass; None where there are no pixels.
    """
    ours = marks["cpu"]
    forward, backward = timings
    return KernelRow(
        operation=ours.operation,
        scene=ours.scene,
        size=size,
        forward=forward,
        backward=backward,
        checked_at=ours.size,
        value_error=ours.value_error,
        gradient_error=ours.gradient_error,
        reference_ratio=marks["reference"].total_ms / ours.total_ms,
        peak_mb=peak_mb,
        forward_pairs_per_s=None if pairs is None else pairs / forward.min_ms * 1e3,
        backward_pairs_per_s=None if pairs is None else pairs / backward.min_ms * 1e3,
    )


@dataclass(frozen=True, slots=True)
class IterationRow:
    """One size and kind of training step: times at full size, errors of the same step in a part of its picture.

    Attributes:
        scene: "joint" (everything learns) or "source" (heads frozen, half of the anchors static and frozen).
        size: Anchors, Gaussians per anchor and picture.
        n_gaussians: Gaussians rendered.
        stages: Name and time of each stage, in order, cut apart at their boundaries.
        total: The whole step without cuts.
        errors: See StepErrors.
        reference_ratio: Time of a whole step in plain torch in float32 over ours, in that part of the picture.
    """

    scene: str
    size: str
    n_gaussians: int
    stages: tuple[tuple[str, Timing], ...]
    total: Timing
    errors: StepErrors
    reference_ratio: float


@dataclass(frozen=True, slots=True)
class StepErrors:
    """Errors of one training step against the same step in float64.

    Attributes:
        checked_at: The part of the picture in which they were found.
        value_error: Largest error of a pixel, colours in 0..1.
        loss_error: Of the loss, relative.
        gradient_error: Largest relative error of a gradient over all trainable tensors, as in SpeedError.
        worst_gradient: Name of that tensor.
        update_error: Largest relative error of Adam's change to a parameter, given the same gradients.
    """

    checked_at: str
    value_error: float
    loss_error: float
    gradient_error: float
    worst_gradient: str
    update_error: float
