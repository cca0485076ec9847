"""The work of `clipgstream eval`: every frame of the chosen clips against every camera, as one JSON-able document.

Figures are kept in the project (app.evaluation.kept_figures), so that an evaluation resumes where it was interrupted,
and eval, report and ablate measure a version of a clip once.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from app.background.kernels import use_threads
from app.evaluation.headless import TrainedProject
from app.evaluation.kept_figures import EVALUATIONS, KeptFigures
from app.project.project import Project
from engine.capture.exclusions import exclusion_key
from engine.metrics.columns import FIGURES_VERSION
from engine.parallel import n_cores

if TYPE_CHECKING:
    from engine.metrics.clips.evaluate import Evaluation
    from engine.metrics.clips.seams import PairRow, SeamMaps
    from engine.metrics.clips.summary import EvalRow
    from engine.metrics.pictures.colors import Precision
    from engine.metrics.pictures.picture import Choice

logger = logging.getLogger(__name__)

EVAL_SCHEMA = 2
KEPT_SCHEMA = 1


@dataclass(frozen=True, slots=True)
class EvaluationScope:
    """The scope of an evaluation.

    Attributes:
        clips: Indices, rising; where one follows the other, the boundary between them is measured.
        cameras: Indices of the cameras to compare with.
        metrics, precision: See engine.metrics.pictures.picture.measure_picture.
    """

    clips: Sequence[int]
    cameras: Sequence[int]
    metrics: Choice
    precision: Precision

    def before(self, clip_index: int) -> int | None:
        """The clip before, where the boundary to it is measured."""
        return clip_index - 1 if clip_index - 1 in self.clips else None


Frames = dict[int, tuple[list[int], list[int]]]
"""Missing figures of a clip, by camera: frames of rows, and later frames of pairs."""


class Measuring(Protocol):
    """Measures missing figures of a clip, in any order; ClipMeasuring, or a test's substitute."""

    def __call__(
        self, opened: TrainedProject, scope: EvaluationScope, clip_index: int, unknown: Frames
    ) -> Iterator[EvalRow | PairRow]: ...


def evaluate_project(
    opened: TrainedProject,
    *,
    clip_indices: Sequence[int],
    cameras: Sequence[int] | None = None,
    metrics: Choice = "all",
    precision: Precision = "float",
    on_progress: Callable[[int, int, Any], None],
    say: Callable[[str], None] = logger.warning,
    measuring: Measuring | None = None,
) -> dict[str, Any]:
    """Compare every frame of the clips with every camera's picture; figures measured before are reused.

    Args:
        clip_indices: Rising; where one follows the other, the boundary between them is measured.
        cameras: Indices of the cameras to compare with; all of them when None.
        metrics, precision: See engine.metrics.pictures.picture.measure_picture.
        on_progress: Gets rows done, rows in all, and the newest row; at first the rows known before, with None.
        say: Receives warnings of kept figures that are damaged or cannot be written.
        measuring: Measures missing figures of a clip; ClipMeasuring when None.
    Returns:
        JSON-able: schema, project, capture, scale, holdout (names), clips, metrics and precision (as chosen), columns
        (engine.metrics.clips.summary.columns_of), rows (EvalRow.as_dict: one per clip, frame and camera), means with
        keys
        all, held_out, trained_on, clips (the same two per clip index), cameras, frames (curves over time) and worst,
        and seams: rows (one per neighbouring frames and camera) and the result of
        engine.metrics.clips.seams.summarize.
        A mean leaves out rows without the figure; it is null where no row has it, and columns counts those rows.
    Raises:
        ProjectError: A clip is not trained or does not fit.
        KeyboardInterrupt: With the progress kept, in a sentence.
    """
    from engine.metrics.clips import seams, summary
    from engine.metrics.clips.summary import EvalRow

    opened = opened.measured
    project, capture = opened.project, opened.capture
    capture.check_pictures()
    chosen_cameras = list(range(len(capture.rig)) if cameras is None else cameras)
    scope = EvaluationScope(list(clip_indices), chosen_cameras, metrics, precision)
    for clip_index in {*scope.clips} - {*opened.trained}:
        opened.load(clip_index)  # raises where a clip is not trained
    kept = {i: kept_figures(opened, scope, i, say) for i in scope.clips}
    unknown = {i: _unknown(opened, scope, i, kept[i]) for i in scope.clips}
    if measuring is None:
        measuring = ClipMeasuring()
        for clip_index in [i for i in scope.clips if unknown[i]]:  # damaged ones are found before the work
            opened.load(clip_index)
    n_rows = sum(len(_usable(opened, i, camera)) for i in scope.clips for camera in scope.cameras)
    n_done = n_rows - sum(len(frames) for todo in unknown.values() for frames, _ in todo.values())
    on_progress(n_done, n_rows, None)
    try:
        for clip_index, todo in unknown.items():
            if not todo:
                continue
            with kept[clip_index].writing():
                for item in measuring(opened, scope, clip_index, todo):
                    kept[clip_index].add(item)
                    if isinstance(item, EvalRow):
                        n_done += 1
                        on_progress(n_done, n_rows, item)
    except KeyboardInterrupt:
        is_kept = all(kept[i].is_writable for i in scope.clips)
        words = "kept; the same command resumes from there" if is_kept else "lost: the project cannot be written to"
        raise KeyboardInterrupt(f"{n_done} of {n_rows} pictures were measured and are {words}.") from None
    rows, pairs = _in_order(opened, scope, kept)

    rows_of: dict[int, list[EvalRow]] = {i: [] for i in scope.clips}
    for row in rows:
        rows_of[row.clip_index].append(row)
    per_clip = {str(i): summary.by_group(found) for i, found in rows_of.items()}
    return {
        "schema": EVAL_SCHEMA,
        "project": str(project.folder),
        "capture": str(capture.path),
        "scale": capture.scale,
        "holdout": list(project.settings.holdout),
        "clips": scope.clips,
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


def kept_figures(
    opened: TrainedProject, scope: EvaluationScope, clip_index: int, say: Callable[[str], None]
) -> KeptFigures:
    """Known figures of a clip.

    Raises:
        ProjectError: The clip, or the one before it, is not trained or damaged.
    """
    clip, config = opened.clips[clip_index], opened.project.settings.config()
    content = {
        "schema": KEPT_SCHEMA,
        "version": FIGURES_VERSION,
        "capture": opened.project.settings.fingerprint,
        "scale": opened.capture.scale,
        "frames": [clip.start, clip.stop, clip.clip_length],
        "clip": _fingerprint(opened, clip_index),
        "reference": opened.reference and opened.reference.header.fingerprint,
        "field": _fingerprint(opened, opened.last_trained) if config.field == "continue" else None,
        "metrics": scope.metrics,
        "precision": scope.precision,
    }
    first = clip.start if scope.before(clip_index) is None else clip.start - 1
    excluded = exclusion_key(opened.project.document.exclusions, (first, clip.stop))
    content |= {"excluded": excluded} if excluded else {}
    before = scope.before(clip_index)
    path = figures_path(opened.project, clip_index, scope.metrics, scope.precision)
    return KeptFigures(path, content, None if before is None else _fingerprint(opened, before), say)


def figures_path(project: Project, clip_index: int, metrics: Choice, precision: Precision) -> Path:
    """The file of a clip's kept figures."""
    return project.folder / EVALUATIONS / f"{clip_index:04d}-{metrics}-{precision}.jsonl"


def is_measured(opened: TrainedProject, scope: EvaluationScope) -> bool:
    """Whether `evaluate_project` would have nothing to measure.

    Raises:
        ProjectError: A clip is not trained or damaged.
    """
    nothing, opened = logger.debug, opened.measured
    return not any(_unknown(opened, scope, i, kept_figures(opened, scope, i, nothing)) for i in scope.clips)


class ClipMeasuring:
    """Measures clips of one project and scope, cameras in parallel on all cores; keeps their backgrounds in between.

    Each camera is measured with one thread, so that its figures do not depend on how many cores there are.

    Args:
        n_threads: How many cameras at a time; as many as cores when None.
    """

    def __init__(self, n_threads: int | None = None) -> None:
        self._n_threads = n_cores() if n_threads is None else n_threads
        self._evaluation: Evaluation | None = None

    def __call__(
        self, opened: TrainedProject, scope: EvaluationScope, clip_index: int, unknown: Frames
    ) -> Iterator[EvalRow | PairRow]:
        """Missing rows and pairs.

        Raises:
            ProjectError: A clip is not trained or damaged.
        """
        use_threads(None)
        from engine.metrics.clips.side_by_side import side_by_side

        if self._evaluation is None:
            self._evaluation = _evaluation(opened, metrics=scope.metrics, precision=scope.precision)
        trained, before_index = opened.load(clip_index), scope.before(clip_index)
        before = None if before_index is None else opened.load(before_index)
        cameras = [
            self._evaluation.of_camera(trained, camera, before=before, frames=frames, pairs=pairs)
            for camera, (frames, pairs) in unknown.items()
        ]
        yield from side_by_side(cameras, n_threads=self._n_threads, prepare=lambda: use_threads(1))


def _fingerprint(opened: TrainedProject, clip_index: int) -> str:
    return opened.header(clip_index).fingerprint


def _unknown(opened: TrainedProject, scope: EvaluationScope, clip_index: int, kept: KeptFigures) -> Frames:
    names = opened.capture.rig.names
    found: Frames = {}
    for camera in scope.cameras:
        name = names[camera]
        frames = [frame for frame in _usable(opened, clip_index, camera) if (name, frame) not in kept.rows]
        later = [f for f in _later_frames(opened, scope, clip_index, camera) if (name, f) not in kept.pairs]
        if frames or later:
            found[camera] = frames, later
    return found


def _usable(opened: TrainedProject, clip_index: int, camera: int) -> list[int]:
    """Frames of a clip that are measured for a camera: those that are not excluded."""
    return [f for f in opened.clips[clip_index].frame_indices() if opened.capture.is_usable(camera, f)]


def _later_frames(opened: TrainedProject, scope: EvaluationScope, clip_index: int, camera: int) -> list[int]:
    """Later frames of all pairs of a clip that are measured for a camera."""
    start, usable = opened.clips[clip_index].start, _usable(opened, clip_index, camera)
    first = start if scope.before(clip_index) is not None else start + 1
    return [f for f in usable if f >= first and f > 0 and opened.capture.is_usable(camera, f - 1)]


def _in_order(
    opened: TrainedProject, scope: EvaluationScope, kept: dict[int, KeptFigures]
) -> tuple[list[EvalRow], list[PairRow]]:
    """Rows and pairs by clip, camera and frame. The project, not the file, decides which cameras are held out."""
    holdout, names = set(opened.project.settings.holdout), opened.capture.rig.names
    rows, pairs = [], []
    for clip_index in scope.clips:
        for camera in scope.cameras:
            name, is_held_out = names[camera], names[camera] in holdout
            found = kept[clip_index]
            frames = _usable(opened, clip_index, camera)
            later = _later_frames(opened, scope, clip_index, camera)
            rows += [replace(found.rows[name, frame], is_held_out=is_held_out) for frame in frames]
            pairs += [replace(found.pairs[name, frame], is_held_out=is_held_out) for frame in later]
    return rows, pairs


def boundary_maps(opened: TrainedProject, *, clip_index: int, camera_index: int) -> SeamMaps:
    """Maps of R, G and E of one camera at the start of a clip, for a picture; see engine.metrics.clips.seams.

    Raises:
        ProjectError: This clip or the one before it is not trained.
        ValueError: There is no clip before this one.
    """
    if clip_index < 1:
        raise ValueError(f"clip {clip_index} has no clip before it")
    return change_maps(opened, frame_index=opened.clips[clip_index].start, camera_index=camera_index)


def change_maps(opened: TrainedProject, *, frame_index: int, camera_index: int) -> SeamMaps:
    """Maps of R, G and E of one camera from the frame before to a frame, whether clips meet there or not.

    Raises:
        ProjectError: A clip of the two frames is not trained.
        ValueError: No frame comes before.
    """
    if not 0 < frame_index < opened.clips[-1].stop:
        raise ValueError(f"frame {frame_index} has no frame before it")
    use_threads(None)
    opened = opened.measured
    before, after = (
        opened.load(next(clip.clip_index for clip in opened.clips if frame < clip.stop))
        for frame in (frame_index - 1, frame_index)
    )
    return _evaluation(opened).change_maps(before, after, camera_index, frame_index)


def _evaluation(opened: TrainedProject, *, metrics: Choice = "all", precision: Precision = "float") -> Evaluation:
    from engine.metrics.clips.evaluate import Evaluation

    return Evaluation(
        opened.capture,
        cameras=range(len(opened.capture.rig)),
        holdout=opened.capture.camera_indices(opened.project.settings.holdout),
        metrics=metrics,
        precision=precision,
    )
