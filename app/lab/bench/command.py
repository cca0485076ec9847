"""clipgstream bench: the table of kernels and settings, the figures as JSON, and a picture of speed against error."""

from __future__ import annotations

import argparse
from pathlib import Path

from app.cli.arguments import EXIT_OK, path_argument
from app.cli.terminal.progress import ProgressLine
from app.cli.terminal.results import named_failure, write_text
from app.export.staging import check_target
from app.training.service import Launch
from engine.capture.capture import open_capture
from engine.errors import ProjectError
from engine.storage.files import atomic_path
from engine.storage.json_files import json_text

CHART_FILE, TRAINED = "speed_error.png", "trained"
DEFAULT_OUT = Path("bench_output")
"""The picture's file unless --out names one, in the current folder."""
DEFAULT_SCALE = 0.5


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
    command.add_argument("--full", action="store_true", help="all scenes, sizes, settings; takes some minutes, not one")
    command.add_argument(
        "--capture",
        type=path_argument,
        help="also train two clips of five frames of this capture with each setting that trades time for error, and "
        f"export them in every format; the projects lie in DIR/{TRAINED}",
    )
    command.add_argument(
        "--scale",
        type=float,
        default=DEFAULT_SCALE,
        help=f"working size of the capture, share of the original in (0, 1] (default: {DEFAULT_SCALE:g})",
    )
    command.add_argument("--threads", type=int, metavar="N", help="threads to compute with (default: every core)")
    command.add_argument("--quiet", action="store_true", help="no progress")


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream bench: measure kernels, with a capture also settings; prints tables. Returns the exit code."""
    chart = options.out / CHART_FILE
    table_file = None if options.json in (None, "-") else Path(options.json)
    for path in (chart, table_file):  # before a minute is spent
        if path is not None:
            check_target(path)
    if options.threads is not None and options.threads < 1:
        raise ProjectError(f"--threads is {options.threads}; at least one is needed.")
    from app.lab.bench.suite import FULL, QUICK, document, run_plan
    from app.lab.bench.table import report_text

    trainings = None
    if options.capture is not None:
        from app.lab.bench.settings.trainings import ShortTrainings

        trainings = ShortTrainings(open_capture(options.capture, scale=options.scale))
    plan = FULL if options.full else QUICK
    line = ProgressLine(is_quiet=options.quiet)

    def say(what: str, done: float) -> None:
        line.update(f"Measuring: {what}", done)

    try:
        report = run_plan(plan, n_threads=options.threads, say=say)
        if trainings is not None:
            from app.lab.bench.settings.exports import measure_exports

            report.trades, trained = trainings.measure(options.out / TRAINED, plan.settings, launch=launch, say=say)
            say("exports", 1.0)
            report.trades += measure_exports(trained)
    finally:
        line.finish()
    text = json_text(document(report), indent=1)
    print(text if options.json == "-" else report_text(report))
    if table_file is not None:
        write_text(table_file, text + "\n")
    from app.lab.bench.chart import draw_speed_error

    with named_failure(chart), atomic_path(chart) as partial:
        draw_speed_error(report.marks, partial, footer=str(report.machine), trades=report.trades)
    line.say(f"Speed against error: {chart}")
    return EXIT_OK
