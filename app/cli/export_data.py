"""clipgstream export --format metrics-csv|metrics-json|cameras-colmap|cameras-transforms: figures and cameras."""

from __future__ import annotations

import argparse

from app.evaluation.headless import TrainedProject
from app.export.export_progress import ExportResult, Report
from app.export.named_jobs import run_named_job
from app.export.picked_frames import PickedFrames

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


def export(
    opened: TrainedProject, options: argparse.Namespace, frames: range | PickedFrames | None, report: Report
) -> ExportResult:
    """Write a file of figures or a folder of cameras. Raises EngineError."""
    return run_named_job(opened, report, options.format, options.out, frames=frames)
