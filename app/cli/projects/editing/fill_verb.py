"""clipgstream edit --fill: fill what was behind something that an edit takes away."""

from __future__ import annotations

import argparse
from collections.abc import Callable

from app.scripting.scripted_project import ScriptedProject


def add_arguments(group: argparse._MutuallyExclusiveGroup) -> None:
    """The option."""
    group.add_argument(
        "--fill", type=int, metavar="ID", help="fill what was behind the things that an edit deletes or hides"
    )


def run(options: argparse.Namespace, project: ScriptedProject, say: Callable[[str], None]) -> None:
    """Fill behind the edit. say: Receives progress and figures, as lines."""
    shown = -1

    def tell(done: int, total: int) -> None:
        nonlocal shown
        percent = 100 * done // max(total, 1)
        if percent // 10 > shown:
            shown = percent // 10
            say(f"{percent} %")

    found = project.fill(options.fill, tell)
    share = 100 * found.n_open / max(found.n_pixels, 1)
    say(
        f"{found.n_gaussians} Gaussians, {found.n_guessed} of them guessed; {found.n_traces} traces are taken "
        f"away, too. {share:.1f} % of the pixels that showed it had nothing behind, {found.n_left} of {found.n_open} "
        "still have nothing."
    )
