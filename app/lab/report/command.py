"""clipgstream report: one page about a project, with progress stage by stage."""

from __future__ import annotations

import argparse

from app.cli.arguments import EXIT_OK, add_figure_choices, add_measuring_places, path_argument
from app.cli.frame_rate_arguments import add_no_fps, wanted_rates
from app.cli.terminal.progress import ProgressLine, stage_progress
from app.export.staging import check_target
from app.project.opening.project_access import read_settings
from app.training.service import Launch


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream report`."""
    command.add_argument("project", type=path_argument, help="project folder")
    command.add_argument(
        "--compare",
        type=path_argument,
        nargs="+",
        action="extend",
        default=[],
        metavar="OTHER",
        help="project folders, or folders of projects, to compare with it",
    )
    command.add_argument(
        "--out", type=path_argument, metavar="DIR", help="folder for the page (default: PROJECT/reports)"
    )
    command.add_argument(
        "--boundary",
        type=int,
        metavar="FRAME",
        help="maps of changes at the start of the clip that begins at this frame (default: where they are worst)",
    )
    command.add_argument("--camera", metavar="NAME", help="camera of these maps (default: where they are worst)")
    command.add_argument(
        "--crop",
        action="append",
        default=[],
        metavar="CAMERA:FRAME:X,Y,W,H",
        help="a window to cut out of the capture and every project, in pixels; may be given several times "
        "(default: where the projects differ most)",
    )
    add_figure_choices(command, default=None, said="all for the project, quick for the others")
    add_measuring_places(command)
    add_no_fps(command)
    command.add_argument("--quiet", action="store_true", help="no progress")


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream report: write a page about a project. Returns the exit code."""
    from app.evaluation.cluster_measuring import measuring_at
    from app.lab.bench.settings.exports import measure_exports
    from app.lab.report.paper_figures.by_hand import FigureOptions
    from app.lab.report.write import PAGE_FILE, REPORTS, write_report

    read_settings(options.project)  # refuses a folder that is not a project before anything else
    check_target((options.project / REPORTS if options.out is None else options.out) / PAGE_FILE)
    line = ProgressLine(is_quiet=options.quiet)
    try:
        with measuring_at(options.n_workers, options.cluster, line.say) as measuring:
            page = write_report(
                options.project,
                compare=options.compare,
                out=options.out,
                metrics=options.metrics,
                precision=options.precision,
                wishes=FigureOptions(options.boundary, options.camera, options.crop),
                on_stage=stage_progress(line),
                say=line.say,
                measuring=measuring,
                rates_of=wanted_rates(options),
                exports_of=measure_exports,
            )
    finally:
        line.finish()
    line.say(f"Report: {page}")
    return EXIT_OK
