"""A whole training step on a synthetic clip: the time of its stages, as it really runs, and how wrong it is."""

from __future__ import annotations

from dataclasses import replace

from app.lab.bench.rows import IterationRow, SpeedError
from app.lab.bench.step import STAGES, StepRun
from app.lab.bench.step_errors import measure_errors
from app.lab.bench.timing import interleaved
from engine.training.plan.synthetic_clip import ClipRecipe

SIZES = {
    "2k": ClipRecipe(2_000, 5, 240, 180),
    "8k": ClipRecipe(8_000, 5, 480, 360),
    "8k k=10": ClipRecipe(8_000, 10, 480, 360),
}


def measure_iteration(
    size: str, *, is_source: bool, n_runs: int, recipe: ClipRecipe | None = None
) -> tuple[IterationRow, list[SpeedError]]:
    """One size and kind; whole and cut steps in turn, then errors.

    Args:
        size: A name of SIZES, or any with `recipe`.
        is_source: Which kind of clip.
        n_runs: Steps that count, of each.
    Returns:
        The row of the table, and the marks of the chart.
    """
    recipe = replace(recipe or SIZES[size], is_source=is_source)
    scene = "source" if is_source else "joint"
    run = StepRun(recipe)
    timings = interleaved({"whole": run.whole, "staged": run.staged}, n_runs, n_warm=3)
    errors, marks = measure_errors(recipe, scene=f"{size} {scene}")
    row = IterationRow(
        scene=scene,
        size=str(recipe),
        n_gaussians=run.n_gaussians,
        stages=tuple(zip(STAGES, timings["staged"], strict=True)),
        total=timings["whole"][0],
        errors=errors,
        reference_ratio=marks["reference"].total_ms / marks["cpu"].total_ms,
    )
    return row, list(marks.values())
