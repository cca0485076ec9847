"""clipgstream export --player OUT.html: the scene as a page that plays it in a browser."""

from __future__ import annotations

import argparse
import sys

from app.cli.terminal.progress import ProgressLine
from app.evaluation.headless import TrainedProject
from app.export.export_progress import ExportResult, Report

NAME = "player"
FORMATS: dict[str, str] = {}
"""None: the page has an option of its own, since it is a file and no folder."""


OPTIONS = ("data_folder",)
TAKES_EDITS = True


def takes_frames(format_name: str) -> bool:
    """Whether frames can be chosen."""
    return True


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Options of the player."""
    own = command.add_argument_group("player")
    own.add_argument(
        "--data-folder",
        action="store_true",
        default=None,
        help="a page with a folder of clips beside it, which are loaded as they are needed (default: for large scenes)",
    )


def export(opened: TrainedProject, options: argparse.Namespace, frames: range | None, report: Report) -> ExportResult:
    """Write the page; says before how large it becomes. Raises ProjectError."""
    from app.export.player_job import PlayerJob, estimate, run

    job = PlayerJob(
        out=options.player, frames=frames, has_folder=options.data_folder, has_edits=not options.without_edits
    )
    for said in estimate(opened, job).lines:
        ProgressLine(sys.stderr, is_quiet=options.quiet).say(said)
    return run(opened, job, report)
