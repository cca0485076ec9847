"""Figures that were measured before, by the window or by `clipgstream eval`: read clip by clip from the project's
evaluations.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from app.evaluation.evaluation import EvaluationScope, figures_path, kept_figures
from app.evaluation.headless import TrainedProject, open_trained
from app.evaluation.kept_figures import EVALUATIONS
from app.project.clips.clip_catalog import ClipCatalog
from app.project.project import Project
from app.residuals.figures import ClipMeasurements, Figures, PairFigures, RowFigures, pair_figures, row_figures
from engine.capture.capture import Capture
from engine.errors import EngineError

if TYPE_CHECKING:
    from engine.metrics.pictures.picture import Choice  # brings torch, which only the thread needs

WINDOW_METRICS: Choice = "all"
"""Metrics of the window: the default of `clipgstream eval`, so that neither repeats the other's work. It takes
half as long again as PSNR and FLIP alone, rendering included."""
Stamp = tuple[tuple[int, int], ...]
"""Size and time of the files of a clip's kept figures: another one once figures are added."""
READ_METRICS: tuple[Choice, ...] = ("quick", WINDOW_METRICS)
"""The choices that are read: quick figures have PSNR and pairs too."""


def note_kept(catalog: ClipCatalog, project: Project, capture: Capture) -> None:
    """Give a catalog the kept figures of its clips, as far as they can be read."""
    trained = [index for index in range(len(catalog)) if catalog[index].state == "trained"]
    try:
        opened = open_trained(project, capture)
    except EngineError:  # nothing is trained, or the reference is damaged
        return
    usable = project.document.exclusions.usable(capture.rig.names, capture.n_frames)
    figures = Figures(opened.clips, len(capture.rig), usable)
    figures.set_trained(trained)
    for found in read_kept(opened, trained, trained, lambda sentence: None):
        figures.take(found)
    catalog.note_evaluated(figures.held_out_psnr(capture.camera_indices(project.settings.holdout)))


def stamps(project: Project, clip_indices: Iterable[int]) -> dict[int, Stamp]:
    """Stamps of the clips of which figures are kept."""
    found: dict[int, Stamp] = {}
    names = set[str]()
    with suppress(OSError):  # the folder comes with the first figures
        names = set(os.listdir(project.folder / EVALUATIONS))
    for clip_index in clip_indices:
        paths = [figures_path(project, clip_index, metrics, "float") for metrics in READ_METRICS]
        with suppress(OSError):  # replaced just now
            states = [path.stat() for path in paths if path.name in names]
            if states:
                found[clip_index] = tuple((state.st_size, state.st_mtime_ns) for state in states)
    return found


def read_kept(
    opened: TrainedProject, trained: Sequence[int], clip_indices: Sequence[int], say: Callable[[str], None]
) -> Iterator[ClipMeasurements]:
    """Known figures of some clips, one clip after another. Damaged clips are left out.

    Args:
        trained: All clips that can be measured.
        clip_indices: Those that are read.
        say: Receives sentences about files that cannot be read.
    """
    cameras = {name: index for index, name in enumerate(opened.capture.rig.names)}
    for clip_index in clip_indices:
        rows: list[RowFigures] = []
        pairs: list[PairFigures] = []
        for metrics in READ_METRICS:
            scope = EvaluationScope(trained, range(len(cameras)), metrics, "float")
            try:
                kept = kept_figures(opened, scope, clip_index, say)
            except EngineError as error:
                say(str(error))
                break
            has_flip = metrics != "quick"
            for (name, _), row in kept.rows.items():
                if name in cameras:
                    rows.append(row_figures(row, cameras[name], has_flip=has_flip))
            pairs += [pair_figures(pair, cameras[name]) for (name, _), pair in kept.pairs.items() if name in cameras]
        yield ClipMeasurements(clip_index, rows, pairs)
