"""The cameras of a project's capture for other programs: as COLMAP's sparse model, or as transforms.json."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from app.evaluation.headless import TrainedProject
from app.export.export_progress import ExportEstimate, ExportProgress, ExportResult, Report, written
from app.export.staging import check_target
from engine.capture.frames import ImageFrames
from engine.capture.writers.conversion import Target, convert

CamerasFormat = Literal["colmap", "transforms"]
CAMERAS_FORMATS: tuple[CamerasFormat, ...] = ("colmap", "transforms")
_TARGETS: dict[CamerasFormat, Target] = {"colmap": "colmap", "transforms": "transforms"}
ROW_BYTES = {"colmap": 240, "transforms": 720}
WORLD = "Cameras stand in the world of the Gaussians, in its units; frames stay where they are."


@dataclass(frozen=True, slots=True)
class CamerasJob:
    """What is asked for. out: A new or empty folder."""

    out: Path
    format: CamerasFormat = "colmap"


def estimate(opened: TrainedProject, job: CamerasJob) -> ExportEstimate:
    """See `JobModule`."""
    layout = opened.capture.layout
    points = layout.points.stat().st_size if layout.points is not None and layout.points.is_file() else 0
    has_images = all(isinstance(entry.source, ImageFrames) for entry in layout.cameras)
    n_rows = len(layout.cameras) * (layout.n_frames if job.format == "transforms" and has_images else 1)
    n_files = 3 if job.format == "colmap" else 1 + (points > 0)
    return ExportEstimate(n_files, n_rows * ROW_BYTES[job.format] + points, (WORLD,))


def run(opened: TrainedProject, job: CamerasJob, report: Report) -> ExportResult:
    """See `JobModule`.

    Raises:
        CaptureError: The layout has no words for a lens.
        ProjectError: The folder cannot be written.
    """
    n_cameras = len(opened.capture.layout.cameras)
    check_target(job.out, n_bytes=estimate(opened, job).n_bytes, is_folder=True)
    report(ExportProgress(0, n_cameras, "cameras"))
    done = convert(opened.capture.layout, job.out, _TARGETS[job.format])
    report(ExportProgress(n_cameras, n_cameras, "cameras"))
    return written(job.out, lines=(WORLD, *done.lines))
