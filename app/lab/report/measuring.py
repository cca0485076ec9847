"""The evaluation that a report shows of a project: the best one that is measured already, or a new one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from app.evaluation.evaluation import EvaluationScope, Measuring, evaluate_project, is_measured
from app.evaluation.headless import TrainedProject

if TYPE_CHECKING:
    from engine.metrics.pictures.colors import Precision
    from engine.metrics.pictures.picture import Choice


def evaluation_of(
    opened: TrainedProject,
    *,
    choices: Sequence[Choice],
    precision: Precision = "float",
    is_held_out_enough: bool = False,
    on_progress: Callable[[int, int, Any], None],
    say: Callable[[str], None],
    measuring: Measuring | None = None,
) -> dict[str, Any]:
    """The evaluation document of a project's trained clips; measures figures that the project lacks.

    Args:
        choices: Metrics that will do, the best first; the last is measured where none is there completely.
        precision: Pictures as rendered, or rounded to 8 bit.
        is_held_out_enough: Leave out cameras that were trained on, where some are held out.
        on_progress, say, measuring: See app.evaluation.evaluation.evaluate_project.
    Raises:
        ProjectError: A clip is damaged or does not fit.
        KeyboardInterrupt: With the progress kept, in a sentence.
    """
    held_out = opened.capture.camera_indices(opened.project.settings.holdout) if is_held_out_enough else []
    cameras = held_out or range(len(opened.capture.rig))
    scopes = [EvaluationScope(opened.trained, cameras, choice, precision) for choice in choices]
    scope = next((scope for scope in scopes if is_measured(opened, scope)), scopes[-1])
    return evaluate_project(
        opened,
        clip_indices=scope.clips,
        cameras=scope.cameras,
        metrics=scope.metrics,
        precision=precision,
        on_progress=on_progress,
        say=say,
        measuring=measuring,
    )
