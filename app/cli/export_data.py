"""clipgstream export --format metrics-csv|metrics-json|cameras-colmap|cameras-transforms: figures and cameras."""

from __future__ import annotations

import argparse

from app.evaluation.headless import TrainedProject
from app.export.export_progress import ExportResult, Report

FORMATS = {
    "metrics-csv": "every figure that was measured, a row per picture",
    "metrics-json": "the same with neighbouring frames and all settings",
    "cameras-colmap": "cameras as COLMAP's sparse model",
    "cameras-transforms": "cameras as transforms.json",
}


OPTIONS = ()
TAKES_EDITS = False


def takes_frames(format_name: str) -> bool:
    """Whether frames can be chosen: cameras stand still."""
    return not format_name.startswith("cameras")


def add_arguments(command: argparse.ArgumentParser) -> None:
    """There are no options beside those of all formats."""


def export(opened: TrainedProject, options: argparse.Namespace, frames: range | None, report: Report) -> ExportResult:
    """Write a file of figures or a folder of cameras. Raises EngineError."""
    from app.export import cameras_job, metrics_job

    if options.format == "cameras-colmap":
        return cameras_job.run(opened, cameras_job.CamerasJob(options.out, "colmap"), report)
    if options.format == "cameras-transforms":
        return cameras_job.run(opened, cameras_job.CamerasJob(options.out, "transforms"), report)
    format_ = "json" if options.format == "metrics-json" else "csv"
    return metrics_job.run(opened, metrics_job.MetricsJob(options.out, format_, frames), report)
