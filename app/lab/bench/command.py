"""clipgstream bench: the table of the kernels, their figures as JSON, and the picture of speed against error."""

from __future__ import annotations

import argparse
from pathlib import Path

from app.cli.arguments import EXIT_OK, path_argument
from app.cli.terminal.progress import ProgressLine
from app.cli.terminal.results import named_failure, write_text
from app.export.staging import check_target
from app.training.service import Launch
from engine.errors import ProjectError
from engine.storage.files import atomic_path
from engine.storage.json_files import json_text

CHART_FILE = "speed_error.png"
DEFAULT_OUT = Path("bench_output")
"""The picture's file unless --out names one, in the current folder."""


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream bench`."""
    command.add_argument(
        "--out",
        type=path_argument,
        default=DEFAULT_OUT,
        metavar="DIR",
        help=f"folder for the picture {CHART_FILE} (default: {DEFAULT_OUT})",
    )
    command.add_argument("--json", metavar="FILE", help="file for all figures; - prints them instead of the table")
    command.add_argument("--full", action="store_true", help="all scenes and sizes; takes some minutes, not one")
    command.add_argument("--threads", type=int, metavar="N", help="threads to compute with (default: every core)")
    command.add_argument("--quiet", action="store_true", help="no progress")


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream bench: measure the kernels; prints the table. Returns the exit code."""
    chart = options.out / CHART_FILE
    table_file = None if options.json in (None, "-") else Path(options.json)
    for path in (chart, table_file):  # before a minute is spent
        if path is not None:
            check_target(path)
    if options.threads is not None and options.threads < 1:
        raise ProjectError(f"--threads is {options.threads}; at least one is needed.")
    from app.lab.bench.suite import FULL, QUICK, document, run_plan
    from app.lab.bench.table import report_text

    line = ProgressLine(is_quiet=options.quiet)
    try:
        report = run_plan(
            FULL if options.full else QUICK,
            n_threads=options.threads,
            say=lambda what, done: line.update(f"Measuring: {what}", done),
        )
    finally:
        line.finish()
    text = json_text(document(report), indent=1)
    print(text if options.json == "-" else report_text(report))
    if table_file is not None:
        write_text(table_file, text + "\n")
    from app.lab.bench.chart import draw_speed_error

    with named_failure(chart), atomic_path(chart) as partial:
        draw_speed_error(report.marks, partial, footer=str(report.machine))
    line.say(f"Speed against error: {chart}")
    return EXIT_OK
