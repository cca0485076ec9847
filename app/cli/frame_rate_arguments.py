"""The argument of commands that measure how fast pictures are rendered unless the user forbids it."""

from __future__ import annotations

import argparse

from app.evaluation.speed.frame_rates import RatesOf, frame_rates


def add_no_fps(command: argparse.ArgumentParser) -> None:
    """Declare --no-fps."""
    command.add_argument(
        "--no-fps",
        action="store_true",
        help="do not measure how many pictures are rendered per second, which takes some seconds a project",
    )


def wanted_rates(options: argparse.Namespace) -> RatesOf:
    """The measuring function; it measures nothing with --no-fps."""
    return (lambda opened: None) if options.no_fps else frame_rates
