"""All figures that were measured of a project, with the settings they were reached with, as CSV or JSON.

Figures are those that the window and `clipgstream eval` keep in the project; nothing is measured here. One row per
clip, frame and camera, also for pictures that were not measured, which say so.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, TextIO

import msgspec

from app.csv_text import csv_text
from app.evaluation.evaluation import EvaluationScope, kept_figures
from app.evaluation.headless import TrainedProject
from app.export.export_progress import ExportEstimate, ExportProgress, ExportResult, Report, written
from app.export.jobs.metrics import MetricsJob
from app.export.staging import check_target, staged_file
from engine.errors import ProjectError
from engine.metrics.columns import COLUMNS
from engine.storage.json_files import json_text
from engine.training.config import config_of

if TYPE_CHECKING:
    from engine.metrics.clips.seams import PairRow
    from engine.metrics.clips.summary import EvalRow
    from engine.metrics.pictures.colors import Precision
    from engine.metrics.pictures.picture import Choice

logger = logging.getLogger(__name__)

SCHEMA = 1
SETTING = "setting_"
"""Columns of training settings begin with this."""
NOT_MEASURED = "not measured"
ROW_BYTES = {"csv": 600, "json": 1700}
"""Of one row, for the estimate."""
_WHICH: tuple[tuple[Choice, Precision], ...] = (
    ("all", "float"),
    ("all", "8bit"),
    ("quick", "float"),
    ("quick", "8bit"),
)
"""Kinds of figures that may be kept of a picture; the first that is there counts."""


def estimate(opened: TrainedProject, job: MetricsJob) -> ExportEstimate:
    """See `JobModule`. Raises ProjectError where nothing is trained among the frames, CaptureError without pictures."""
    chosen = _Chosen(opened, job)
    n_rows = sum(len(frames) for frames in chosen.frames.values()) * len(opened.capture.rig)
    return ExportEstimate(1, n_rows * ROW_BYTES[job.format], chosen.lines())


def run(opened: TrainedProject, job: MetricsJob, report: Report) -> ExportResult:
    """See `JobModule`.

    Raises:
        ProjectError: Nothing is trained among the frames, a clip is damaged, or the file cannot be written.
    """
    chosen = _Chosen(opened, job)
    check_target(job.out, opened=opened, n_bytes=estimate(opened, job).n_bytes)
    with staged_file(job.out, what="The table") as partial, partial.open("w", encoding="utf-8", newline="\n") as file:
        (_write_csv if job.format == "csv" else _write_json)(chosen, file, report)
    lines = chosen.lines()
    if chosen.n_unmeasured:
        n_all = chosen.n_measured + chosen.n_unmeasured
        said = f"{chosen.n_unmeasured:,} of {n_all:,} pictures were not measured; `clipgstream eval` measures them."
        lines = (*lines, said)
    return written(job.out, lines=(*lines, *chosen.said))


class _Chosen:
    """The clips of a job and the figures kept of them, one clip at a time."""

    def __init__(self, opened: TrainedProject, job: MetricsJob) -> None:
        opened.capture.check_pictures()
        self.opened, trained = opened, opened.trained
        wanted = range(opened.capture.n_frames) if job.frames is None else job.frames
        touched = {
            clip.clip_index: frames
            for clip in opened.clips
            if (frames := [frame for frame in clip.frame_indices() if frame in wanted])
        }
        self.frames = {index: frames for index, frames in touched.items() if index in trained}
        self.untrained = [index for index in touched if index not in trained]
        if not self.frames:
            raise ProjectError(
                "None of these frames is trained, so there are no figures.",
                hint="Train first, or choose other frames.",
                path=opened.project.folder,
            )
        self.headers = {index: opened.header(index) for index in self.frames}
        self.n_measured = self.n_unmeasured = 0
        self.said: tuple[str, ...] = ()

    def lines(self) -> tuple[str, ...]:
        """Sentences that the user should know beforehand."""
        n = len(self.untrained)
        if not n:
            return ()
        return (f"{n} {'clip is' if n == 1 else 'clips are'} not trained and left out.",)

    def settings(self, clip_index: int) -> dict[str, Any]:
        """Training settings of a clip that differ from the defaults."""
        return dict(self.headers[clip_index].config)

    @property
    def setting_names(self) -> list[str]:
        """Of all settings that differ from the default in some clip."""
        return sorted({name for index in self.frames for name in self.settings(index)})

    def kept(self, clip_index: int) -> tuple[list[dict[str, Any]], list[PairRow]]:
        """Rows of a clip, and the known figures of its neighbouring frames."""
        names, holdout = self.opened.capture.rig.names, set(self.opened.project.settings.holdout)
        found: dict[tuple[str, int], tuple[str, str, EvalRow]] = {}
        pairs: dict[tuple[str, int], PairRow] = {}
        for metrics, precision in reversed(_WHICH):
            scope = EvaluationScope(self.opened.trained, range(len(names)), metrics, precision)
            kept = kept_figures(self.opened, scope, clip_index, self._say)
            found |= {key: (metrics, precision, row) for key, row in kept.rows.items()}
            pairs |= kept.pairs
        rows: list[dict[str, Any]] = []
        for frame in self.frames[clip_index]:
            for name in names:
                which = {"clip_index": clip_index, "frame_index": frame, "camera": name, "is_held_out": name in holdout}
                metrics, precision, row = found.get((name, frame), (None, None, None))
                figures = dict.fromkeys(COLUMNS) if row is None else row.figures
                missing = NOT_MEASURED if row is None else _missing_text(row.missing)
                rows.append(which | {"metrics": metrics, "precision": precision} | figures | {"missing": missing})
                self.n_measured += row is not None
                self.n_unmeasured += row is None
        wanted = set(self.frames[clip_index])
        return rows, [pair for (name, frame), pair in sorted(pairs.items()) if frame in wanted and name in names]

    def _say(self, sentence: str) -> None:
        if sentence not in self.said:
            self.said = (*self.said, sentence)


def _missing_text(missing: dict[str, str]) -> str:
    """Reasons for figures that do not exist, each with its figures."""
    columns: dict[str, list[str]] = {}
    for name, reason in missing.items():
        columns.setdefault(reason, []).append(name)
    return "; ".join(f"{', '.join(names)}: {reason}" for reason, names in columns.items())


def _clips(chosen: _Chosen, report: Report) -> Iterator[tuple[int, list[dict[str, Any]], list[PairRow]]]:
    n_clips = len(chosen.frames)
    report(ExportProgress(0, n_clips, "clips"))
    for done, clip_index in enumerate(chosen.frames, start=1):
        rows, pairs = chosen.kept(clip_index)
        yield clip_index, rows, pairs
        report(ExportProgress(done, n_clips, "clips"))


def _write_csv(chosen: _Chosen, file: TextIO, report: Report) -> None:
    opened = chosen.opened
    settings, names = opened.project.settings, chosen.setting_names
    defaults = config_of({})
    for clip_index, rows, _ in _clips(chosen, report):
        header = chosen.headers[clip_index]
        own = chosen.settings(clip_index)
        about: dict[str, Any] = {
            "scale": opened.capture.scale,
            "clip_length": settings.clip_length,
            "seed": header.seed,
            "steps": header.step,
            "clip": header.fingerprint,
        }
        about |= {SETTING + name: own.get(name, getattr(defaults, name, None)) for name in names}
        text = csv_text([*rows[0], *about], [row | about for row in rows])
        file.write(text if file.tell() == 0 else text.partition("\n")[2])


def _write_json(chosen: _Chosen, file: TextIO, report: Report) -> None:
    """One object, written clip by clip, so that a long capture does not have to be in memory."""
    opened = chosen.opened
    settings = opened.project.settings
    head = {
        "schema": SCHEMA,
        "project": str(opened.project.folder),
        "capture": str(opened.capture.path),
        "capture_fingerprint": opened.capture.fingerprint,
        "cameras": list(opened.capture.rig.names),
        "holdout": list(settings.holdout),
        "scale": opened.capture.scale,
        "fps": opened.capture.fps,
        "clip_length": settings.clip_length,
        "reference_clip": settings.reference_clip,
        "untrained_clips": chosen.untrained,
        "settings": msgspec.to_builtins(settings.config()),
        "columns": {column.name: {"unit": column.unit, "definition": column.definition} for column in COLUMNS.values()},
    }
    file.write(json_text(head)[:-1] + ', "clips": [')
    for place, (clip_index, rows, pairs) in enumerate(_clips(chosen, report)):
        header = chosen.headers[clip_index]
        clip = {
            "clip_index": clip_index,
            "start": header.start,
            "n_frames": header.n_frames,
            "role": header.role,
            "fingerprint": header.fingerprint,
            "steps": header.step,
            "seed": header.seed,
            "settings": chosen.settings(clip_index),
            "n_anchors": header.n_anchors,
            "training": msgspec.to_builtins(header.figures),
            "pictures": rows,
            "neighbours": [asdict(pair) for pair in pairs],
        }
        file.write(("\n" if place == 0 else ",\n") + json_text(clip))
    file.write("\n]}\n")
