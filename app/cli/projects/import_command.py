"""clipgstream import: a scene of another program as a project."""

from __future__ import annotations

import argparse

from app.cli.arguments import EXIT_OK, path_argument
from app.cli.terminal.progress import ProgressLine, row_progress
from app.importing.import_scene import import_scene
from app.training.service import Launch
from engine.export.world import AXES


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream import`."""
    command.add_argument(
        "scene", type=path_argument, help="a file over time, a folder with a file of Gaussians per frame, or one file"
    )
    command.add_argument(
        "--project", required=True, type=path_argument, metavar="DIR", help="new folder of the project"
    )
    command.add_argument(
        "--fps", type=float, metavar="F", help="frames per second (default: as the scene says, else 30)"
    )
    ways = command.add_mutually_exclusive_group()
    for flag, sign, text in (("--up", "+", "up"), ("--down", "-", "down")):
        ways.add_argument(
            flag,
            dest="up",
            type=lambda axis, sign=sign: sign + axis,
            choices=[axis for axis in AXES if axis[0] == sign],
            metavar="AXIS",
            help=f"x, y or z: this axis of the scene points {text}"
            + (" (default: as the scene says, else y)" if sign == "-" else ""),
        )
    command.add_argument("--scale", type=float, metavar="S", help="length of a unit of the scene in metres")
    command.add_argument("--quiet", action="store_true", help="show no progress")


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream import: make a project of a scene. Returns the exit code."""
    line = ProgressLine(is_quiet=options.quiet)
    progress = row_progress(line, "Reading frames")
    done = import_scene(
        options.scene,
        options.project,
        fps=options.fps,
        up=options.up,
        meters_per_unit=options.scale,
        report=lambda n_done, n: progress(n_done, n, None),
    )
    line.finish()
    for said in done.notes:
        line.say(f"Note: {said}")
    line.say(f"Frames: {done.n_frames}, clips: {done.n_clips}, project: {done.folder}")
    return EXIT_OK
