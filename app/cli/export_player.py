"""clipgstream export --player OUT.html: the scene as a page that plays it in a browser."""

from __future__ import annotations

import argparse
import sys

from app.cli.terminal.progress import ProgressLine
from app.evaluation.headless import TrainedProject
from app.export.export_jobs import KINDS
from app.export.export_progress import ExportResult, Report
from app.export.named_jobs import named_job
from app.export.picked_frames import PickedFrames

NAME = "player"
FORMATS: dict[str, str] = {}
"""None: the page has an option of its own, since it is a file and no folder."""


OPTIONS = ("data_folder", "one_file")
TAKES_EDITS = True


def takes_frames(format_name: str) -> bool:
    """Whether frames can be chosen."""
    return True


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Options of the player."""
    own = command.add_argument_group("player")
    data = own.add_mutually_exclusive_group()
    data.add_argument(
        "--data-folder",
        action="store_true",
        default=None,
        help="a page with a folder of clips beside it, which are loaded as they are needed (default: for large scenes)",
    )
    data.add_argument("--one-file", action="store_true", help="everything in the page, however large that becomes")


def export(
    opened: TrainedProject, options: argparse.Namespace, frames: range | PickedFrames | None, report: Report
) -> ExportResult:
    """Write the page; says before how large it becomes. Raises ProjectError."""
    kind, job = named_job(
        NAME,
        options.player,
        frames=frames,
        has_folder=False if options.one_file else options.data_folder,
        has_edits=not options.without_edits,
    )
    work = KINDS[kind].load()
    for said in work.estimate(opened, job).lines:
        ProgressLine(sys.stderr, is_quiet=options.quiet).say(said)
    return work.run(opened, job, report)
