"""The kinds of exports: one table, from which command line, form and scripts follow."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from app.export.jobs.cameras import CamerasJob
from app.export.jobs.gaussians import GaussiansJob
from app.export.jobs.job import ExportJob
from app.export.jobs.metrics import MetricsJob
from app.export.jobs.player import PlayerJob
from app.export.jobs.sequence import SequenceJob
from app.export.jobs.video import VideoJob
from engine.errors import ProjectError
from engine.setting import settings_of
from engine.text import shown

KINDS: dict[str, type[ExportJob]] = {
    job.kind: job for job in (GaussiansJob, SequenceJob, VideoJob, PlayerJob, MetricsJob, CamerasJob)
}
"""By name, in the order in which they are offered."""


def formats_of(command: str = "") -> dict[str, type[ExportJob]]:
    """The job of each format that a command takes, or of every one."""
    jobs = [job for job in KINDS.values() if command in ("", job.command)]
    return {name: job for job in jobs for name in job.formats()}


def named_job(format_name: str, out: Path | str, **options: Any) -> ExportJob:
    """The job of a format.

    Args:
        format_name: One of `formats_of()`.
        out: File or folder.
        options: Other entries of the job; None takes the usual value.
    Raises:
        ProjectError: There is no such format, or it has no such option.
    """
    known = formats_of()
    if format_name not in known:
        raise ProjectError(f"There is no format {shown(format_name)}.", hint=f"Formats are {', '.join(known)}.")
    job = known[format_name]
    given = {name: value for name, value in options.items() if value is not None}
    known_options = [name for name in settings_of(job) if name != "format"]
    unknown = [name for name in given if name not in known_options]
    if unknown:
        raise ProjectError(
            f"There is no option {shown(unknown[0])} of {format_name}.",
            hint=f"Options are {', '.join(known_options)}." if known_options else "There are none.",
        )
    chosen = {"format": job.formats()[format_name]} if job.takes("format") else {}
    return job(Path(out), **chosen, **given)
