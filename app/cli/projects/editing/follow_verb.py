"""The verb `follow` of `clipgstream edit`: `edit PROJECT follow --object "left player" --edit 3`."""

from __future__ import annotations

import argparse

from engine.errors import ProjectError

FOLLOW, MEANING = "follow", "lets the volume of an edit go along with an object"
_HINT = 'Write for example: follow --object "left player" --edit 3.'


def add_follow_arguments(command: argparse.ArgumentParser) -> None:
    """The edit that follows."""
    command.add_argument("--edit", type=int, metavar="ID", help="follow: the edit whose volume follows --object")


def take_follow(options: argparse.Namespace) -> bool:
    """Whether the verb is `follow`. What is to be followed, and by which edit, goes into `follow`; None otherwise.

    Raises:
        ProjectError: Something is missing, or given without the verb.
    """
    options.follow = None
    if options.words[:1] != [FOLLOW]:
        if options.edit is not None:
            raise ProjectError("--edit is given without follow.", hint=_HINT)
        return False
    if len(options.words) > 1:
        raise ProjectError(f"follow is followed by '{options.words[1]}', which is not an option of it.", hint=_HINT)
    if options.object is None or options.edit is None:
        missing = "--object" if options.object is None else "--edit"
        raise ProjectError(f"follow needs {missing}.", hint=_HINT)
    options.follow, options.object = (options.object, options.edit), None
    return True
