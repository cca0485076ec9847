"""Errors of a training step: picture, loss, gradients and update, against the same step in float64 and plain torch.

Clip, frame and camera are those of the step that is timed, and all its anchors are decoded. Only the picture is cut
down to its middle, because the rasterizer's slow truth draws every Gaussian against every pixel.
"""

from __future__ import annotations

from torch import Tensor

from app.lab.bench.compared import COMPARED, EXACT, FAST
from app.lab.bench.raster import relative_errors
from app.lab.bench.rows import SpeedError, StepErrors
from app.lab.bench.step import StepRun, StepWindow
from app.lab.bench.timing import interleaved
from engine.backends.backend import Backend
from engine.training.plan.synthetic_clip import ClipRecipe

WINDOW_PX = 64, 48
"""Width and height of the part that is compared; smaller pictures are compared whole."""
N_CHECK_RUNS = 2
N_UPDATES = 3
"""Steps of Adam that are compared: the first one alone would not show its memory."""


def measure_errors(recipe: ClipRecipe, *, scene: str, fast: Backend = FAST) -> tuple[StepErrors, dict[str, SpeedError]]:
    """One size and kind.

    Args:
        recipe: Of the step that is timed.
        scene: Name for the chart.
        fast: The back end to compare with the slow truth.
    Returns:
        Errors of the fast path, and the marks of the chart: "cpu" and, for plain torch in float32, "reference".
    """
    window = middle(recipe)
    checked_at = f"{window.width}x{window.height} of {recipe.width}x{recipe.height}"
    if (window.width, window.height) == (recipe.width, recipe.height):
        checked_at = f"{recipe.width}x{recipe.height}"
    truth = StepRun(recipe, backend=EXACT, window=window).kept()
    runs = {
        name: StepRun(recipe, backend=backend, window=window) for name, backend in (COMPARED | {"cpu": fast}).items()
    }
    first = {backend: run.kept() for backend, run in runs.items()}  # parameters still are those of the truth
    timings = interleaved({backend: run.whole for backend, run in runs.items()}, N_CHECK_RUNS, n_warm=0)
    marks = {}
    for backend, outcome in first.items():
        marks[backend] = SpeedError(
            operation="step",
            scene=scene,
            size=f"{recipe.n_anchors} anchors, {checked_at}",
            backend=backend,
            total_ms=timings[backend][0].median_ms,
            value_error=(outcome.image - truth.image).abs().max().item(),
            gradient_error=max(_by_name(outcome.gradients, truth.gradients).values()),
        )
    by_name = _by_name(first["cpu"].gradients, truth.gradients)
    errors = StepErrors(
        checked_at=checked_at,
        value_error=marks["cpu"].value_error,
        loss_error=abs(first["cpu"].loss - truth.loss) / abs(truth.loss),
        gradient_error=marks["cpu"].gradient_error,
        worst_gradient=max(by_name, key=by_name.__getitem__),
        update_error=_update_error(recipe, window, fast),
    )
    return errors, marks


def middle(recipe: ClipRecipe) -> StepWindow:
    """The part of a picture that is compared: its middle, or all of it where it is no larger."""
    width, height = min(WINDOW_PX[0], recipe.width), min(WINDOW_PX[1], recipe.height)
    return StepWindow((recipe.width - width) // 2, (recipe.height - height) // 2, width, height)


def _by_name(actual: dict[str, Tensor], expected: dict[str, Tensor]) -> dict[str, float]:
    """Relative error of each tensor; those whose truth is zero are left out."""
    return {name: relative_errors([actual[name]], [truth]) for name, truth in expected.items() if truth.norm() > 0}


def _update_error(recipe: ClipRecipe, window: StepWindow, fast: Backend) -> float:
    """Adam of the fast path compared with float64 given the very same gradients.

    With its own gradients float64 would differ without meaning: the first step of Adam is the sign of a gradient,
    and there are entries whose gradient is all rounding.
    """
    run, exact = StepRun(recipe, backend=fast, window=window), StepRun(recipe, backend=EXACT, window=window)
    worst = 0.0
    for _ in range(N_UPDATES):
        outcome = run.kept()
        expected = exact.updated(outcome.gradients)
        worst = max(worst, *_by_name(outcome.updates, expected).values())
    return worst
