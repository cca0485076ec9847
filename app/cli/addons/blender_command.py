"""clipgstream blender: the add-on with which Blender opens exported sequences."""

from __future__ import annotations

import argparse
from pathlib import Path

from app.cli.arguments import EXIT_OK, path_argument
from app.training.service import Launch
from engine.export.blender_addon import FILE, write_addon


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream blender`."""
    command.add_argument(
        "--out",
        type=path_argument,
        default=Path(),
        metavar="DIR",
        help=f"folder to write {FILE} into (default: the present one)",
    )


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream blender: write the add-on, say how to install it. Returns the exit code."""
    print(f"{write_addon(options.out.absolute())}")
    print("In Blender 4.2 or later: Edit > Preferences > Add-ons > Install from Disk")
    return EXIT_OK
