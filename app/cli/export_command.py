"""clipgstream export: a trained project as files of other programs. One module per kind of file does the work."""

from __future__ import annotations

import argparse
import time
from types import ModuleType
from typing import Any

from app.cli import export_data, export_gaussians, export_player
from app.cli.arguments import EXIT_OK, parse_range, path_argument
from app.cli.terminal.progress import ProgressLine, row_progress
from app.evaluation.headless import TrainedProject, open_trained
from app.export.export_progress import ExportProgress, ExportResult
from app.export.picked_frames import PickedFrames, picked_frames
from app.project.project import open_project
from app.training.service import Launch
from engine.errors import ProjectError
from engine.storage.json_files import json_text

EXPORT_SCHEMA = 1
KINDS: tuple[ModuleType, ...] = (export_gaussians, export_data, export_player)
"""Modules with `FORMATS`, names for --format with what each is; `add_arguments(command)`, options of their own, which
`OPTIONS` names; `TAKES_EDITS`, whether edits change what is written; `takes_frames(format)`; and
`export(opened, options, frames, report)`, which writes and returns an ExportResult. frames: None where nothing was
chosen."""


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream export`."""
    command.add_argument("project", type=path_argument, help="project folder")
    known = [f"{name}: {summary}" for kind in KINDS for name, summary in kind.FORMATS.items()]
    what = command.add_mutually_exclusive_group(required=True)
    what.add_argument(
        "--format",
        choices=[name for kind in KINDS for name in kind.FORMATS],
        help=f"what to write; {'; '.join(known)}",
    )
    what.add_argument(
        "--player", type=path_argument, metavar="OUT.html", help="a page that plays the scene in a browser"
    )
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
    command.add_argument("--without-edits", action="store_true", help="the scene as it was trained")
    command.add_argument("--json", action="store_true", help="print what was written as JSON on standard output")
    command.add_argument("--quiet", action="store_true", help="no progress")
    for kind in KINDS:
        kind.add_arguments(command)


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream export: write files. Returns the exit code."""
    started_s = time.monotonic()
    if options.player is None and options.out is None:
        raise ProjectError("--out is missing.", hint="Name a new folder: --out DIR.")
    kind = next((kind for kind in KINDS if options.format in kind.FORMATS), export_player)
    _check_options(options, kind)
    opened = open_trained(open_project(options.project, is_writable=False))
    line = ProgressLine(is_quiet=options.quiet)
    show = row_progress(line, "Exporting")

    def report(progress: ExportProgress) -> None:
        if progress.n_all:
            show(progress.n_done, progress.n_all, None)

    result: ExportResult = kind.export(opened, options, _frames(options, opened), report)
    seconds = time.monotonic() - started_s
    line.finish()
    for said in result.lines:
        line.say(said)
    files = f"{result.n_files} file{'' if result.n_files == 1 else 's'}"
    line.say(f"{files}, {result.n_bytes / 1e6:.1f} MB, in {seconds:.1f} s: {result.path}")
    if options.json:
        print(json_text(_document(options, result, seconds), indent=1))
    return EXIT_OK


def _check_options(options: argparse.Namespace, kind: ModuleType) -> None:
    """What was asked for and would be passed over is an error."""
    parser = argparse.ArgumentParser()
    for other in KINDS:
        if other is not kind:
            other.add_arguments(parser)
    unused = [name for other in KINDS if other is not kind for name in other.OPTIONS]
    if not kind.takes_frames(options.format):
        parser.set_defaults(frames=None, clip=None, step=1)
        unused += ["frames", "clip", "step"]
    if options.player is not None:
        unused.append("out")
    if not kind.TAKES_EDITS:
        parser.set_defaults(without_edits=False)
        unused.append("without_edits")
    for name in unused:
        if getattr(options, name) != parser.get_default(name):
            what = options.format or export_player.NAME
            raise ProjectError(f"--{name.replace('_', '-')} does not apply to {what}.", hint="Leave it out.")


def _frames(options: argparse.Namespace, opened: TrainedProject) -> range | PickedFrames | None:
    """The chosen frames; None for all that are trained. Raises ProjectError where there are no such frames."""
    if options.step < 1:
        raise ProjectError(f"--step is {options.step}.", hint="Write 1 for every frame, 2 for every second one.")
    if options.clip is not None:
        if not 0 <= options.clip < len(opened.clips):
            hint = f"The project has clips 0 to {len(opened.clips) - 1}."
            raise ProjectError(f"There is no clip {options.clip}.", hint=hint)
        chosen = opened.clips[options.clip].frame_indices()
    elif options.frames is not None:
        return _frame_ranges(options, opened.capture.n_frames)
    elif options.step == 1:
        return None
    else:
        trained = [frame for i in sorted(opened.trained) for frame in opened.clips[i].frame_indices()]
        chosen = range(trained[0], trained[-1] + 1) if trained else range(0)
        if len(chosen) > len(trained):
            raise ProjectError(
                "--step is given without --frames, and clips between those that are trained are not.",
                hint="Say which frames: --frames A:B.",
            )
    return range(chosen.start, chosen.stop, options.step)


def _frame_ranges(options: argparse.Namespace, n_frames: int) -> range | PickedFrames:
    """One range, or several that rise. Raises ProjectError."""
    spans: list[tuple[int, int]] = []
    for part in options.frames.split(","):
        chosen = parse_range(part, n_frames, option="--frames", what="frames")
        if spans and chosen.start < spans[-1][1]:
            raise ProjectError(f"--frames is '{options.frames}', where ranges do not follow each other.")
        spans.append((chosen.start, chosen.stop))
    return picked_frames(spans, options.step)


def _document(options: argparse.Namespace, result: ExportResult, seconds: float) -> dict[str, Any]:
    return {
        "schema": EXPORT_SCHEMA,
        "format": options.format or export_player.NAME,
        "path": str(result.path),
        "n_files": result.n_files,
        "n_bytes": result.n_bytes,
        "psnr_db": result.psnr_db,
        "lines": list(result.lines),
        "seconds": round(seconds, 2),
    }
