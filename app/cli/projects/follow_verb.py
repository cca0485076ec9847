"""The verb `follow` of `clipgstream edit`: `edit PROJECT follow --object "left player" --edit 3`."""

from __future__ import annotations

import argparse
from dataclasses import dataclass

from engine.errors import ProjectError


@dataclass(frozen=True, slots=True)
class FollowVerb:
    """The verb. meaning: Its effect, for help."""

    meaning: str


VERBS = {"follow": FollowVerb("lets the volume of an edit go along with an object")}
_HINT = 'Write for example: follow --object "left player" --edit 3.'


def add_verb_arguments(command: argparse.ArgumentParser) -> None:
    """The edit that follows."""
    command.add_argument(
        "--edit", type=int, metavar="ID", help="follow: the edit whose volume goes along with --object"
    )


def take_verb(options: argparse.Namespace) -> None:
    """Put what is to be followed, and by which edit, into `follow`; None for another verb.

    Raises:
        ProjectError: Something is missing, or given without the verb.
    """
    options.follow = None
    if options.verb != "follow":
        if options.edit is not None:
            raise ProjectError("--edit is given without follow.", hint=_HINT)
        return
    if options.object is None or options.edit is None:
        missing = "--object" if options.object is None else "--edit"
        raise ProjectError(f"follow needs {missing}.", hint=_HINT)
    options.follow, options.object = (options.object, options.edit), None
