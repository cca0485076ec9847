"""clipgstream report: one page about a project, with progress stage by stage."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

from app.arguments import EXIT_OK
from app.progress import ProgressLine, row_progress
from app.project import read_settings
from app.results import check_writable
from app.training.service import Launch


def report(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream report: write a page about a project. Returns the exit code."""
    from app.report.cache import REPORTS
    from app.report.write import PAGE_FILE, write_report

    read_settings(options.project)  # a folder that is no project is said first
    check_writable((options.project / REPORTS if options.out is None else options.out) / PAGE_FILE)
    line = ProgressLine(is_quiet=options.quiet)
    shown: dict[str, Callable[[int, int, Any], None]] = {}

    def show(stage: str, done: int, n: int) -> None:
        shown.setdefault(stage, row_progress(line, stage))(done, n, None)

    try:
        page = write_report(
            options.project,
            compare=options.compare,
            out=options.out,
            metrics=options.metrics,
            precision=options.precision,
            on_stage=show,
        )
    finally:
        line.finish()
    line.say(f"Report: {page}")
    return EXIT_OK
