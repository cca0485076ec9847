"""clipgstream mend: make a seam or a stretch of flicker smaller, with figures before and after; and take it back."""

from __future__ import annotations

import argparse
from typing import Any

from msgspec import to_builtins

from app.cli.arguments import EXIT_FAILED, EXIT_OK, parse_range, path_argument
from app.cli.terminal.progress import ProgressLine
from app.mending.mend_project import MendOutcome, mend_project
from app.mending.request import MendRequest
from app.project.clips.clip_versions import list_versions
from app.project.mends.in_place import as_cut_now, take_back
from app.project.mends.record import kept_record, record_numbers
from app.project.opening.opening import open_capture_of
from app.project.opening.project_access import open_project
from app.project.project import Project
from app.training.service import Launch
from engine.errors import ProjectError
from engine.mending.figures import METHODS, StretchFigures
from engine.progress import Progress
from engine.storage.json_files import json_text

SCHEMA = 1


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream mend`."""
    command.add_argument("project", type=path_argument, help="project folder")
    command.add_argument("--boundary", metavar="A|B", help="two neighbouring clips, as 1|2 or 1:2")
    command.add_argument("--frames", metavar="A:B", help="frames A up to B that flicker, B not included")
    command.add_argument(
        "--method",
        choices=("auto", *METHODS),
        default="auto",
        help="auto: each in turn, until half of the flicker is gone (default); "
        + "; ".join(f"{name}: {words}" for name, words in METHODS.items()),
    )
    command.add_argument("--revert", action="store_true", help="revert the last mend")
    command.add_argument("--json", action="store_true", help="print the result as JSON")
    command.add_argument("--quiet", action="store_true", help="show no progress")


def run(options: argparse.Namespace, launch: Launch) -> int:
    """Mend, or take back. Returns the exit code: 1 where nothing helped."""
    project = open_project(options.project)
    try:
        if options.revert:
            if options.boundary or options.frames:
                raise ProjectError("--revert undoes the last mend and takes no frames.")
            return _revert(project, options)
        request = _request(project, options)
        line = ProgressLine(is_quiet=options.quiet)

        def report(progress: Progress) -> None:
            line.update(progress.stage, progress.done, progress.message)

        outcome = mend_project(project, request, report=report)
        line.finish()
        if options.json:
            print(json_text(_document(project, outcome), indent=2))
        else:
            print("\n".join(lines_of(project, outcome)))
    finally:
        project.close()
    return EXIT_OK if outcome.record.has_helped else EXIT_FAILED


def _request(project: Project, options: argparse.Namespace) -> MendRequest:
    if bool(options.boundary) == bool(options.frames):
        raise ProjectError("Name what to mend: --boundary A|B or --frames A:B.")
    settings = project.settings
    capture = open_capture_of(settings, project.folder)
    capture.check_pictures()
    if options.frames:
        frames = parse_range(options.frames, capture.n_frames, option="--frames", what="frames")
        return MendRequest(frames=(frames.start, frames.stop), method=options.method)
    parts = options.boundary.replace("|", ":").split(":")
    if len(parts) != 2 or not all(part.strip().isascii() and part.strip().isdecimal() for part in parts):
        raise ProjectError(f"--boundary {options.boundary} is not two clips.", hint="Write it as 1|2 or 1:2.")
    before, after = int(parts[0]), int(parts[1])
    if after != before + 1:
        raise ProjectError(f"Clips {before} and {after} are not neighbours.", hint="Write it as 1|2 or 1:2.")
    return MendRequest(after=after, method=options.method)


def _revert(project: Project, options: argparse.Namespace) -> int:
    numbers = record_numbers(project)
    record = kept_record(project, numbers[-1]) if numbers else None
    if record is None:
        raise ProjectError("Nothing was mended in this project.", path=project.folder)
    record = as_cut_now(project, record)
    take_back(project, record)
    if options.json:
        clips = [clip.clip_index for clip in record.clips]
        print(json_text({"schema": SCHEMA, "reverted": numbers[-1], "clips": clips}, indent=2))
    else:
        print(f"{record.words[0].upper()}{record.words[1:]} is as before mending.")
    return EXIT_OK


def _document(project: Project, outcome: MendOutcome) -> dict[str, Any]:
    record = to_builtins(outcome.record, str_keys=True)
    return {"schema": SCHEMA, "project": str(project.folder), "number": outcome.number, **record}


def lines_of(project: Project, outcome: MendOutcome) -> list[str]:
    """The result, as lines of text."""
    record = outcome.record
    lines = [f"{record.words[0].upper()}{record.words[1:]}: {record.diagnosis}"]
    for attempt in record.attempts:
        kept = "kept" if attempt.is_kept else "not kept"
        lines.append(f"{attempt.words} ({attempt.seconds:.0f} s): {figures_text(attempt.figures)}; {kept}")
    lines.append(f"Before: {figures_text(record.before)}")
    lines.append(f"After:  {figures_text(record.after)}")
    if not record.has_helped:
        lines.append("Nothing helped; all clips are as they were.")
    for clip in record.clips:
        versions = [one for one in list_versions(project, clip.clip_index) if one.header is not None]
        number = next((one.number for one in versions if one.header and one.header.fingerprint == clip.before), None)
        lines.append(f"The previous clip {clip.clip_index} is its version {number}; --revert restores it.")
    return lines + ([record.advice] if record.advice else [])


def figures_text(figures: StretchFigures) -> str:
    """Figures in one line."""
    psnr = ", ".join(f"clip {index} {value:.2f}" for index, value in figures.psnr.items())
    text = f"excess flicker {_figure(figures.excess)}/255, PSNR {psnr} dB"
    if figures.held_out_excess is not None:
        held_out = ", ".join(f"clip {index} {value:.2f}" for index, value in figures.held_out_psnr.items())
        text += f" (held out, every frame: {_figure(figures.held_out_excess)}/255, {held_out} dB)"
    return text


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"
