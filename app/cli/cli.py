"""The command line without a window: parser and dispatch. Every command lies in a file of its own (app.cli.commands).

Exit codes: 0 done, 1 failed, 2 bad input, 130 interrupted. One plain message each, details in the log file. Results
go to standard output, progress and messages to standard error.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import logging
import signal
import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from typing import TextIO

from app.background.logs import start_logging
from app.cli.arguments import EXIT_BAD_INPUT, EXIT_FAILED, PlainParser, add_backend, fail, parse
from app.cli.commands import COMMANDS
from app.training.process import ProcessWorker
from app.training.service import Launch
from engine.backends.table import choose_backend
from engine.errors import CaptureError, DiskError, EngineError, ProjectError
from engine.kernels.cache import use_kernel_cache
from engine.own_modules import module_name
from engine.text import printable

logger = logging.getLogger(__name__)

EXIT_INTERRUPTED = 130


def build_parser(used: Collection[str]) -> PlainParser:
    """The parser of all commands; only those in `used` are imported and know their arguments."""
    parser = PlainParser(prog="clipgstream", description="Train, measure and render dynamic captures without a window.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, command in COMMANDS.items():
        about = f"{command.summary[0].upper()}{command.summary[1:]}."
        subparser = commands.add_parser(name, help=command.summary, description=about)
        if name in used:
            command.load().add_arguments(subparser)
            if command.has_backend:
                add_backend(subparser)
    return parser


def parsers_of_commands() -> dict[str, PlainParser]:
    """Every command's parser with all its arguments, by name."""
    parser = build_parser(used=COMMANDS)
    return next(action for action in parser._actions if isinstance(action, argparse._SubParsersAction)).choices


def main(argv: Sequence[str] | None = None, *, launch: Launch = ProcessWorker) -> int:
    """Run one subcommand.

    Args:
        argv: Arguments after the program's name; those of the process when None.
        launch: Starts a training worker; a process by default.
    Returns:
        The exit code.
    """
    use_kernel_cache()  # before a command imports kernels
    arguments = list(sys.argv[1:] if argv is None else argv)
    try:
        options = parse(build_parser(used=arguments[:1]), arguments)
    except SystemExit as error:  # argparse has said what is wrong
        return int(error.code or 0)
    except BrokenPipeError:  # whoever read the help has left
        return EXIT_FAILED
    log_file = start_logging()
    try:
        if "backend" in options:
            choose_backend(options.backend)
        with (
            _terminating_like_ctrl_c(),
            contextlib.redirect_stdout(PrintableStream(sys.stdout)),
            notes_on_terminal(),
        ):
            return COMMANDS[options.command].load().run(options, launch)
    except DiskError as error:
        return fail(EXIT_FAILED, str(error))
    except (CaptureError, ProjectError) as error:
        return fail(EXIT_BAD_INPUT, str(error))
    except EngineError as error:
        return fail(EXIT_FAILED, str(error))
    except PermissionError as error:  # a path of the command line below a folder that may not even be looked into
        return fail(EXIT_BAD_INPUT, f"{error.strerror}. Choose a folder you may use. - {error.filename}")
    except KeyboardInterrupt as error:
        said = ["Interrupted.", str(error), COMMANDS[options.command].interrupted]
        return fail(EXIT_INTERRUPTED, " ".join(part for part in said if part))
    except BrokenPipeError:  # whoever read our output has left
        return EXIT_FAILED
    except Exception as error:  # the edge of the command line: one line, no traceback
        logger.exception("%s failed", options.command)
        where = f" Details are in {log_file}." if log_file else ""
        return fail(EXIT_FAILED, f"{type(error).__name__}: {error}. This is a bug in the program.{where}")


@contextlib.contextmanager
def _terminating_like_ctrl_c() -> Iterator[None]:
    """SIGTERM stops as cleanly as Ctrl+C does."""

    def interrupt(signum: int, frame: object) -> None:
        raise KeyboardInterrupt

    try:
        before = signal.signal(signal.SIGTERM, interrupt)
    except ValueError:  # not the main thread
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


DOCUMENTS = "app.document"
"""Warnings of this package are about what the user made, so that the log alone is not enough."""


class _Notes(logging.Handler):
    """Prints every warning once, however often the project is read."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._said: set[str] = set()

    def emit(self, record: logging.LogRecord) -> None:
        """Print a record on standard error."""
        note = record.getMessage()
        if note not in self._said:
            self._said.add(note)
            sys.stderr.write(printable(f"Note: {note}") + "\n")


@contextmanager
def notes_on_terminal() -> Iterator[None]:
    """In this block, report on standard error missing parts of projects that are read."""
    handler, package = _Notes(), logging.getLogger(module_name(DOCUMENTS))
    package.addHandler(handler)
    try:
        yield
    finally:
        package.removeHandler(handler)


class PrintableStream(io.TextIOBase):
    """A text stream in front of another, for results: all text through it is printable.

    Args:
        stream: As sys.stdout. Characters that its encoding lacks are written out too.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")

    def write(self, text: str, /) -> int:
        """Write text; returns its length."""
        self._stream.write(printable(text))
        return len(text)

    def flush(self) -> None:
        """Hand on what waits."""
        self._stream.flush()

    def isatty(self) -> bool:
        """Whether a terminal shows it."""
        return self._stream.isatty()

    def writable(self) -> bool:
        """It is."""
        return True
