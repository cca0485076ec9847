"""clipgstream render: the trained scene as a video, or as a folder of PNG or OpenEXR files."""

from __future__ import annotations

import argparse

from app.cli.arguments import EXIT_OK, parse_range, path_argument
from app.cli.job_arguments import add_job_arguments, given_entries
from app.cli.terminal.progress import ProgressLine
from app.evaluation.headless import TrainedProject, open_trained
from app.export.edits_line import included_lines
from app.export.jobs.video import VideoJob
from app.export.video.formats import FORMATS, format_of
from app.project.opening.project_access import open_project
from app.training.service import Launch
from engine.errors import ProjectError
from engine.text import rate_text, size_text


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream render`."""
    command.add_argument("project", type=path_argument, help="project folder")
    command.add_argument(
        "--out", type=path_argument, required=True, metavar="FILE|DIR", help="FILE.mp4, FILE.webm, or a new folder"
    )
    command.add_argument(
        "--format", choices=tuple(FORMATS), help="what to write (default: by the name; PNG files into a folder)"
    )
    command.add_argument(
        "--frames",
        default=":",
        metavar="A:B",
        help="frames A up to B, B not included (default: all trained frames, or those of the path)",
    )
    add_job_arguments(command, [VideoJob])
    command.add_argument("--quiet", action="store_true", help="show no progress")


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream render: write pictures. Returns the exit code."""
    from app.export.video.render import render_video

    opened = open_trained(open_project(options.project, is_writable=False))
    job = job_of(options, opened)
    line = ProgressLine(is_quiet=options.quiet)
    for said in included_lines(opened, job):
        line.say(said)
    written = render_video(job, opened, lambda progress: line.update(progress.stage, progress.done, progress.message))
    for note in written.notes:
        line.say(note)
    if written.depth_unit is not None:
        line.say(f"One of the 16-bit levels is {written.depth_unit:g} scene units; 0 is where nothing is.")
    width, height = written.size
    pictures = f"{written.n_pictures} picture{'' if written.n_pictures == 1 else 's'} of {width} x {height}"
    line.say(f"{pictures}, {rate_text(written.fps)} per second, {size_text(written.n_bytes / 1e6)}, in {written.out}")
    return EXIT_OK


def job_of(options: argparse.Namespace, opened: TrainedProject) -> VideoJob:
    """The job that the arguments ask for. Raises ProjectError where one cannot be understood."""
    out = options.out
    format_name = options.format or format_of(out)
    suffixes = FORMATS[format_name].suffixes
    if suffixes and out.suffix.lower() not in suffixes:
        raise ProjectError(
            f"--format is {format_name}, but --out ends in '{out.suffix}'.", hint=f"Name a file {suffixes[0]}."
        )
    entries = given_entries(options, VideoJob, opened)
    if options.frames.strip() != ":":
        entries["frames"] = parse_range(options.frames, opened.capture.n_frames, option="--frames", what="frames")
    return VideoJob(out, format_name, **entries)
