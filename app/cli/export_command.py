"""clipgstream export: a trained project as files of other programs."""

from __future__ import annotations

import argparse
import time
from typing import Any

from app.cli.arguments import EXIT_OK, path_argument
from app.cli.job_arguments import add_job_arguments, check_given, chosen_frames, given_entries
from app.cli.terminal.progress import ProgressLine, row_progress
from app.evaluation.headless import open_trained
from app.export.edits_line import included_lines
from app.export.export_progress import ExportProgress, ExportResult
from app.export.jobs.job import ExportJob
from app.export.jobs.table import KINDS, formats_of, named_job
from app.export.picked_frames import frames_text
from app.project.opening.project_access import open_project
from app.training.service import Launch
from engine.errors import ProjectError
from engine.setting import settings_of
from engine.storage.json_files import json_text
from engine.text import size_text

EXPORT_SCHEMA = 1


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream export`. What has formats is asked for with --format, anything else by its kind."""
    command.add_argument("project", type=path_argument, help="project folder")
    jobs = _jobs()
    known = {
        name: settings_of(job)["format"].choices[value]
        for job in jobs
        if job.takes("format")
        for name, value in job.formats().items()
    }
    what = command.add_mutually_exclusive_group(required=True)
    words = "; ".join(f"{name}: {use}" for name, use in known.items())
    what.add_argument("--format", choices=tuple(known), help=f"what to write; {words}")
    for job in jobs:
        if not job.takes("format"):
            about = f"{job.about[0].lower()}{job.about[1:].rstrip('.')}"
            like = f"OUT{job.suffix('')}"
            what.add_argument(f"--{job.kind}", dest=f"out_{job.kind}", type=path_argument, metavar=like, help=about)
    command.add_argument("--out", type=path_argument, metavar="PATH", help="new or empty folder; of figures a file")
    frames = command.add_mutually_exclusive_group()
    frames.add_argument(
        "--frames",
        metavar="A:B",
        help="frames A up to B, B not included, or one frame A; several of these with commas (default: all trained)",
    )
    frames.add_argument("--clip", type=int, metavar="N", help="frames of this clip")
    command.add_argument(
        "--step", type=int, default=1, metavar="N", help="only every N-th of these frames (default: 1)"
    )
    command.add_argument("--json", action="store_true", help="print what was written as JSON on standard output")
    command.add_argument("--quiet", action="store_true", help="show no progress")
    add_job_arguments(command, jobs)


def _jobs() -> list[type[ExportJob]]:
    return [job for job in KINDS.values() if job.command == "export"]


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream export: write files. Returns the exit code."""
    started_s = time.monotonic()
    check_options(options)
    opened = open_trained(open_project(options.project, is_writable=False))
    job = job_of(options, opened)
    line = ProgressLine(is_quiet=options.quiet)
    for said in included_lines(opened, job):
        line.say(said)
    work = job.load()
    said_before = work.estimate(opened, job).lines
    for said in said_before:
        line.say(said)
    show = row_progress(line, "Exporting")

    def report(progress: ExportProgress) -> None:
        if progress.n_all:
            show(progress.n_done, progress.n_all, None)

    result = work.run(opened, job, report)
    seconds = time.monotonic() - started_s
    line.finish()
    for said in result.lines:
        if said not in said_before:
            line.say(said)
    files = f"{result.n_files} file{'' if result.n_files == 1 else 's'}"
    line.say(f"{files}, {size_text(result.n_bytes / 1e6)}, in {seconds:.1f} s: {result.path}")
    if options.json:
        print(json_text(_document(job, result, seconds), indent=1))
    return EXIT_OK


def check_options(options: argparse.Namespace) -> None:
    """Check that something is to be written somewhere, and that every option applies to it. Raises ProjectError."""
    name, out = _what(options)
    if out is None:
        raise ProjectError("--out is missing.", hint="Name a new folder: --out DIR.")
    check_given(options, _jobs(), formats_of()[name])
    if out is not options.out is not None:
        raise ProjectError(f"--out does not apply to {name}.", hint="Leave it out.")


def job_of(options: argparse.Namespace, opened: Any) -> ExportJob:
    """The job that the arguments ask for. Raises ProjectError where there is none."""
    name, out = _what(options)
    entries = given_entries(options, formats_of()[name], opened)
    if formats_of()[name].takes("frames"):
        entries["frames"] = chosen_frames(options, opened)
    return named_job(name, out, **entries)


def _what(options: argparse.Namespace) -> tuple[str, Any]:
    """Name of the format, and where it is written to."""
    if options.format is not None:
        return options.format, options.out
    kinds = [job.kind for job in _jobs() if getattr(options, f"out_{job.kind}", None) is not None]
    return kinds[0], getattr(options, f"out_{kinds[0]}")


def _document(job: ExportJob, result: ExportResult, seconds: float) -> dict[str, Any]:
    asked = {name: getattr(job, name) for name in settings_of(type(job)) if name != "format"}
    if (frames := asked.get("frames")) is not None:
        asked |= {"frames": frames_text(frames), "step": frames.step}
    return {
        "schema": EXPORT_SCHEMA,
        "format": job.format_name,
        "options": asked,
        "path": str(result.path),
        "n_files": result.n_files,
        "n_bytes": result.n_bytes,
        "psnr_db": result.psnr_db,
        "lines": list(result.lines),
        "seconds": round(seconds, 2),
    }
