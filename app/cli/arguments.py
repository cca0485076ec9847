"""Parts that subcommands share: argparse with errors in one line, ranges, cameras, codes."""

from __future__ import annotations

import argparse
import difflib
import logging
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from engine.backends.table import AUTO, backend_names
from engine.errors import ProjectError
from engine.text import printable, shown

if TYPE_CHECKING:
    from engine.capture.capture import Capture

logger = logging.getLogger(__name__)

EXIT_OK, EXIT_FAILED, EXIT_BAD_INPUT = 0, 1, 2
EXIT_STOPPED = 3
"""Of `train --clip`: somebody stopped it, in a window or by another program; progress is kept."""
EXIT_NOT_READY = 75
"""Of `train --clip`: nothing is wrong, but it cannot be done yet. The number of "try again later" in sysexits.h."""

_LONGEST_INSIDE = 200
"""Bytes of the longest name that the program adds to a folder it was given."""


def fail(code: int, message: str) -> int:
    """Say in one line, and in the log, why a subcommand ends with this exit code. Returns the code."""
    logger.error("exit %d: %s", code, message)
    print(printable(f"clipgstream: {message}"), file=sys.stderr)
    return code


def suggestion(word: str, known: Iterable[str]) -> str:
    """ " Did you mean X?" for what was probably meant; empty where nothing is near."""
    near = difflib.get_close_matches(word.lower(), {name.lower(): name for name in known}, n=1, cutoff=0.65)
    names = [name for name in known if near and name.lower() == near[0]]
    return f" Did you mean {names[0]}?" if names else ""


class PlainParser(argparse.ArgumentParser):
    """Reports an error in one line and how to get help. Options are written in full: `--seed` is not `--seeds`.

    Attributes:
        verbs: By words that may follow the first argument, parsers for all that comes after them.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"allow_abbrev": False, **options})
        self.verbs: dict[str, PlainParser] = {}

    def parse_known_args(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, args: Any = None, namespace: Any = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """As argparse does; after a verb, by its own parser. The option `verb` says which, None for none."""
        if not self.verbs:
            return super().parse_known_args(args, namespace)
        words = list(sys.argv[1:] if args is None else args)
        verb = words[1] if len(words) > 1 and words[1] in self.verbs else None
        options, unknown = super().parse_known_args(words if verb is None else words[:1], namespace)
        options.verb = verb
        if verb is None:
            return options, unknown
        return self.verbs[verb].parse_known_args(words[2:], options)

    def error(self, message: str) -> NoReturn:
        """End the program with exit code 2 and one line."""
        end = "" if message.endswith("?") else "."
        self.exit(EXIT_BAD_INPUT, printable(f"{self.prog}: {message}{end} See `{self.prog} --help`.") + "\n")

    def options_of(self, command: str | None, verb: str | None = None) -> list[str]:
        """Options of a subcommand and its verb, or of this parser where there is none, as they are written."""
        parser: argparse.ArgumentParser = self
        for action in self._actions:
            if isinstance(action, argparse._SubParsersAction) and command in action.choices:
                parser = action.choices[command]
        if isinstance(parser, PlainParser) and verb is not None:
            parser = parser.verbs[verb]
        return list(parser._option_string_actions)


def parse(parser: PlainParser, argv: Sequence[str] | None) -> argparse.Namespace:
    """Arguments after the program's name (those of the process when None) as options.

    Arguments left over are reported with the help of the subcommand they were meant for. Raises SystemExit as
    argparse does.
    """
    options, unknown = parser.parse_known_args(argv)
    if unknown:
        command = getattr(options, "command", None)
        verb = getattr(options, "verb", None)
        known = parser.options_of(command, verb)
        near = next((found for part in unknown if part.startswith("-") and (found := suggestion(part, known))), "")
        parser.prog = f"{parser.prog} {command}" if command else parser.prog
        parser.prog = f"{parser.prog} PROJECT {verb}" if verb else parser.prog
        parser.error(f"unrecognized arguments: {' '.join(unknown)}" + (f".{near}" if near else ""))
    return options


def add_figure_choices(command: argparse.ArgumentParser, *, default: str | None, said: str) -> None:
    """Arguments of every subcommand that measures. said: the default of --metrics, for the help."""
    command.add_argument(
        "--metrics",
        choices=("quick", "all"),
        default=default,
        help=f"quick: PSNR, SSIM and DSSIM1 only (default: {said})",
    )
    command.add_argument(
        "--precision",
        choices=("float", "8bit"),
        default="float",
        help="compare pictures as rendered, or rounded as in a PNG file (default: float)",
    )


def add_cluster(command: argparse._ActionsContainer, *, does: str, things: str) -> None:
    """The argument of every subcommand that can use a Ray cluster. does, things: For the help, as "train" and
    "clips"."""
    command.add_argument(
        "--cluster",
        metavar="WHERE",
        help=f"{does} on the computers of a Ray cluster: auto, HOST:PORT, or local:N for N {things} side by side here",
    )


def add_measuring_places(command: argparse.ArgumentParser) -> None:
    """Arguments of every subcommand that can measure in several processes."""
    places = command.add_mutually_exclusive_group()
    places.add_argument(
        "--workers",
        dest="n_workers",
        type=count_of("processes"),
        default=1,
        metavar="N",
        help="measure in N processes, at most one per core (default: 1); figures are the same",
    )
    add_cluster(places, does="measure", things="processes")


def count_of(what: str) -> Callable[[str], int]:
    """The type of an argument that is a number of something, at least one. what: In the plural."""

    def count(text: str) -> int:
        if not text.strip().isdecimal() or int(text) < 1:
            raise argparse.ArgumentTypeError(f"{shown(text)} is not a number of {what}, 1 or more")
        return int(text)

    return count


def path_argument(text: str) -> Path:
    """A path of the command line; text that cannot be a path is refused at once with exit code 2."""
    if not text.strip():
        raise argparse.ArgumentTypeError("it is empty; name a folder")
    try:
        os.lstat(os.path.join(text, "x" * _LONGEST_INSIDE))
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        pass  # reported better by whoever uses it
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise argparse.ArgumentTypeError(f"{shown(text)} cannot be used as a path ({reason})") from error
    return Path(text)


def add_backend(command: argparse.ArgumentParser) -> None:
    """The argument of everything that trains, decodes or draws clips."""
    command.add_argument(
        "--backend",
        default=argparse.SUPPRESS,  # then it is chosen otherwise
        metavar="NAME",
        help=f"back end: {backend_names()} (default: {AUTO}, the first that works on this machine)",
    )


def add_follow_links(command: argparse.ArgumentParser) -> None:
    """The argument of every subcommand that opens a capture by its name."""
    command.add_argument(
        "--follow-links",
        action="store_true",
        help="read files outside the capture folder if the capture names any",
    )


def parse_range(text: str, n: int, *, option: str, what: str) -> range:
    """ "A:B", "A:", ":B", ":" or "A" as a range inside range(n).

    Raises:
        ProjectError: It is malformed, empty or reaches outside; names what is allowed.
    """
    first, colon, last = text.partition(":")
    allowed = f"The capture has {what} 0 to {n - 1}; write {option} 0:{n} for all of them."
    try:
        start = int(first) if first.strip() else 0
        stop = (int(last) if last.strip() else n) if colon else start + 1
        if not colon and not first.strip():
            raise ValueError
    except ValueError as error:
        raise ProjectError(f"{option} is '{text}', which is not a range A:B.", hint=allowed) from error
    if not 0 <= start < stop <= n:
        raise ProjectError(f"{option} is '{text}', which is empty or out of range.", hint=allowed)
    return range(start, stop)


def parse_cameras(text: str, capture: Capture) -> tuple[str, ...]:
    """Camera names separated by commas; numbers that are not names count cameras from 0. "none" is an empty choice.

    Raises:
        ProjectError: There is no such camera.
    """
    names = capture.rig.names
    chosen = []
    for part in (part.strip() for part in text.split(",")):
        if part in names:
            chosen.append(part)
        elif part.isdigit() and int(part) < len(names):
            chosen.append(names[int(part)])
        elif part and part.lower() != "none":
            shown = f"{', '.join(names[:6])}, ... {names[-1]}" if len(names) > 7 else ", ".join(names)
            raise ProjectError(
                f"There is no camera '{part}'.{suggestion(part, names)}",
                hint=f"Cameras are {shown}, or numbers from 0 to {len(names) - 1}.",
            )
    return tuple(dict.fromkeys(chosen))
