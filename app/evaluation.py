"""What `clipgstream eval` does: every frame of the chosen clips against every camera, as one JSON-able document."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from app.headless import TrainedProject
from app.kernels import use_threads

if TYPE_CHECKING:
    from engine.metrics.colors import Precision
    from engine.metrics.evaluate import Evaluation
    from engine.metrics.picture import Choice
    from engine.metrics.seams import PairRow, SeamMaps
    from engine.metrics.summary import EvalRow

EVAL_SCHEMA = 1


def evaluate_project(
    opened: TrainedProject,
    *,
    clip_indices: Sequence[int],
    cameras: Sequence[int] | None = None,
    metrics: Choice = "all",
    precision: Precision = "float",
    on_progress: Callable[[int, int, Any], None],
) -> dict[str, Any]:
    """Compare every frame of the clips with what every camera took.

    Args:
        clip_indices: Rising; where one follows the other, the boundary between them is measured.
        cameras: Indices of the cameras to compare with; all of them when None.
        metrics, precision: See engine.metrics.picture.measure_picture.
        on_progress: Gets rows done, rows in all, and the newest row.
    Returns:
        JSON-able: schema, project, capture, scale, holdout (names), clips, metrics and precision (as chosen), columns
        (engine.metrics.summary.columns_of), rows (EvalRow.as_dict: one per clip, frame and camera), means with keys
        all, held_out, trained_on, clips (the same two per clip index), cameras, frames (curves over time) and worst,
        and seams: rows (one per neighbouring frames and camera) and what engine.metrics.seams.summarize returns.
        A mean leaves out rows without the figure; it is null where no row has it, and columns counts those rows.
    Raises:
        ProjectError: A clip is not trained or does not fit.
    """
    use_threads(None)
    from engine.metrics import seams, summary

    project, capture = opened.project, opened.capture
    for clip_index in clip_indices:  # what is not trained or damaged is found before the work; one is kept at a time
        opened.load(clip_index)
    evaluation = _evaluation(opened, cameras=cameras, metrics=metrics, precision=precision)
    n_rows = sum(opened.clips[i].n_frames for i in clip_indices) * len(evaluation.cameras)
    rows: list[EvalRow] = []
    pairs: list[PairRow] = []

    def take(row: EvalRow) -> None:
        rows.append(row)
        on_progress(len(rows), n_rows, row)

    before = None
    for clip_index in clip_indices:
        trained = opened.load(clip_index)
        evaluation.measure(trained, before=before, on_row=take, on_pair=pairs.append)
        before = trained

    per_clip = {str(i): summary.by_group([row for row in rows if row.clip_index == i]) for i in clip_indices}
    return {
        "schema": EVAL_SCHEMA,
        "project": str(project.folder),
        "capture": str(capture.path),
        "scale": capture.scale,
        "holdout": list(project.settings.holdout),
        "clips": list(clip_indices),
        "metrics": metrics,
        "precision": precision,
        "columns": summary.columns_of(rows),
        "rows": [row.as_dict() for row in rows],
        "means": {
            "all": summary.means(rows),
            **summary.by_group(rows),
            "clips": per_clip,
            "cameras": summary.by_camera(rows),
            "frames": summary.by_frame(rows),
            "worst": summary.worst_by_group(rows),
        },
        "seams": {"rows": [pair.as_dict() for pair in pairs], **seams.summarize(pairs)},
    }


def boundary_maps(opened: TrainedProject, *, clip_index: int, camera_index: int) -> SeamMaps:
    """Maps of R, G and E of one camera at the start of a clip, for a picture; see engine.metrics.seams.

    Raises:
        ProjectError: This clip or the one before it is not trained.
        ValueError: There is no clip before this one.
    """
    if clip_index < 1:
        raise ValueError(f"clip {clip_index} has no clip before it")
    use_threads(None)
    before, after = opened.load(clip_index - 1), opened.load(clip_index)
    return _evaluation(opened).boundary_maps(before, after, camera_index)


def _evaluation(
    opened: TrainedProject,
    *,
    cameras: Sequence[int] | None = None,
    metrics: Choice = "all",
    precision: Precision = "float",
) -> Evaluation:
    from engine.metrics.evaluate import Evaluation

    return Evaluation(
        opened.capture,
        cameras=range(len(opened.capture.rig)) if cameras is None else cameras,
        holdout=opened.capture.camera_indices(opened.project.settings.holdout),
        metrics=metrics,
        precision=precision,
    )
