"""Jobs by the names of their formats, as the command line and scripts call them."""

from __future__ import annotations

import importlib
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

from app.export.export_jobs import KINDS, Job
from app.export.export_progress import ExportResult, Report
from engine.errors import ProjectError
from engine.text import shown

if TYPE_CHECKING:
    from app.evaluation.headless import TrainedProject


class JobFormat(NamedTuple):
    """One row.

    Attributes:
        kind: One of app.export.export_jobs.KINDS.
        module, job: Where the job is declared, and its name there.
        fixed: Entries of the job that the format says.
    """

    kind: str
    module: str
    job: str
    fixed: dict[str, Any]

    @property
    def job_type(self) -> type:
        """The job; imports its module."""
        return getattr(importlib.import_module(self.module), self.job)


def _gaussians(name: str) -> JobFormat:
    return JobFormat("gaussians", "app.export.gaussians_job", "GaussiansJob", {"format": name})


def _video(name: str) -> JobFormat:
    return JobFormat("video", "app.export.video.job", "VideoJob", {"format": name})


VIDEO_FORMATS = ("mp4", "webm", "png", "exr")
JOB_FORMATS: dict[str, JobFormat] = {
    **{name: _gaussians(name) for name in ("ply", "compressed-ply", "spz", "splat", "glb", "sog")},
    "player": JobFormat("player", "app.export.player_job", "PlayerJob", {}),
    **{
        f"metrics-{name}": JobFormat("metrics", "app.export.metrics_job", "MetricsJob", {"format": name})
        for name in ("csv", "json")
    },
    **{
        f"cameras-{name}": JobFormat("cameras", "app.export.cameras_job", "CamerasJob", {"format": name})
        for name in ("colmap", "transforms")
    },
    **{name: _video(name) for name in VIDEO_FORMATS},
}
"""Everything that leaves a project, by its name."""


def named_job(format_name: str, out: Path | str, **options: Any) -> tuple[str, Job]:
    """The job of a format.

    Args:
        format_name: One of JOB_FORMATS.
        out: File or folder.
        options: Entries of the job beside these two; None takes the usual value.
    Returns:
        The kind, one of app.export.export_jobs.KINDS, and the job.
    Raises:
        ProjectError: There is no such format, or it has no such option.
    """
    if format_name not in JOB_FORMATS:
        known = ", ".join(JOB_FORMATS)
        raise ProjectError(f"There is no format {shown(format_name)}.", hint=f"Formats are {known}.")
    row = JOB_FORMATS[format_name]
    job_type = row.job_type
    given = {name: value for name, value in options.items() if value is not None}
    known_options = [field.name for field in fields(job_type) if field.name not in ("out", *row.fixed)]
    unknown = [name for name in given if name not in known_options]
    if unknown:
        raise ProjectError(
            f"There is no option {shown(unknown[0])} of {format_name}.",
            hint=f"Options are {', '.join(known_options)}." if known_options else "There are none.",
        )
    return row.kind, cast("Job", job_type(out=Path(out), **row.fixed, **given))


def run_named_job(
    opened: TrainedProject, report: Report, format_name: str, out: Path | str, **options: Any
) -> ExportResult:
    """Carry out the job of a format, on this thread.

    Args:
        opened: What is exported.
        report: Told how far it is.
        format_name, out, options: See `named_job`.
    Raises:
        EngineError: It cannot be written; nothing is left.
    """
    kind, job = named_job(format_name, out, **options)
    return KINDS[kind].load().run(opened, job, report)


def format_name_of(kind: str, job: Job) -> str:
    """The name of a job's format: the opposite of `named_job`."""
    for name, row in JOB_FORMATS.items():
        if row.kind == kind and all(getattr(job, entry) == value for entry, value in row.fixed.items()):
            return name
    raise ValueError(f"{job} is not a job of the kind {kind}")
