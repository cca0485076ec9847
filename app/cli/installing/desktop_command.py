"""clipgstream desktop: the program in the menu of a Linux desktop."""

from __future__ import annotations

import argparse

from app.cli.arguments import EXIT_OK
from app.training.service import Launch


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream desktop`."""
    command.add_argument(
        "action", choices=("install", "remove"), help="write the entry and the icon for this user, or remove them"
    )


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream desktop: write or remove the entry. Returns the exit code."""
    from app.cli.installing import desktop

    if options.action == "install":
        for path in desktop.install():
            print(f"wrote {path}")
    else:
        for path in desktop.remove() or ["nothing: the menu had no such entry"]:
            print(f"removed {path}")
    return EXIT_OK
