"""The command line without a window: train, eval, render, inspect, gate, doctor, bench, ablate, report.

Parser and dispatch; every command lies in a file of its own.
Exit codes: 0 done, 1 failed, 2 bad input, 130 interrupted. One plain message each, details in the log file. Results
go to standard output, progress and messages to standard error.
"""

from __future__ import annotations

import argparse
import contextlib
import logging
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from app.background.logs import start_logging
from app.cli.arguments import COMMANDS, EXIT_BAD_INPUT, EXIT_FAILED, PlainParser, fail, parse
from app.cli.doctor_command import add_doctor_arguments, doctor
from app.cli.eval_command import add_eval_arguments, evaluate
from app.cli.gate_command import add_gate_arguments, gate
from app.cli.inspect_command import add_inspect_arguments, inspect
from app.cli.printable_stream import PrintableStream
from app.cli.render_command import add_render_arguments, render
from app.cli.train_command import add_train_arguments, train
from app.lab.ablation.command import ablate, add_ablate_arguments
from app.lab.bench.command import add_bench_arguments, bench
from app.lab.report.command import add_report_arguments, report
from app.training.process import ProcessWorker
from app.training.service import Launch
from engine.errors import CaptureError, DiskError, EngineError, ProjectError
from engine.kernels.cache import use_kernel_cache

logger = logging.getLogger(__name__)

EXIT_INTERRUPTED = 130
_GOES_ON = "What was learned is kept; the same command goes on from there."
_INTERRUPTED = {
    "train": _GOES_ON,
    "ablate": _GOES_ON,
    "eval": "The result was not written.",
    "report": "The page was not written.",
    "render": "A video was not written; single pictures that were finished are there.",
}
"""What has become of the work, by command, beside what the interruption itself says."""


def build_parser() -> PlainParser:
    """Arguments of every subcommand."""
    parser = PlainParser(prog="clipgstream", description="Train, measure and render dynamic captures without a window.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, command in _COMMANDS.items():
        command.add_arguments(commands.add_parser(name, help=COMMANDS[name], description=command.description))
    return parser


def main(argv: Sequence[str] | None = None, *, launch: Launch = ProcessWorker) -> int:
    """Run one subcommand.

    Args:
        argv: Arguments after the program's name; those of the process when None.
        launch: Starts a training worker; a process by default.
    Returns:
        The exit code.
    """
    use_kernel_cache()  # before a command imports kernels
    try:
        options = parse(build_parser(), argv)
    except SystemExit as error:  # argparse has said what is wrong
        return int(error.code or 0)
    log_file = start_logging()
    try:
        with _terminating_like_ctrl_c(), contextlib.redirect_stdout(PrintableStream(sys.stdout)):
            return _COMMANDS[options.command].run(options, launch)
    except DiskError as error:
        return fail(EXIT_FAILED, str(error))
    except (CaptureError, ProjectError) as error:
        return fail(EXIT_BAD_INPUT, str(error))
    except EngineError as error:
        return fail(EXIT_FAILED, str(error))
    except PermissionError as error:  # a path of the command line below a folder that may not even be looked into
        return fail(EXIT_BAD_INPUT, f"{error.strerror}. Choose a folder you may use. - {error.filename}")
    except KeyboardInterrupt as error:
        said = ["Interrupted.", str(error), _INTERRUPTED.get(options.command, "")]
        return fail(EXIT_INTERRUPTED, " ".join(part for part in said if part))
    except BrokenPipeError:  # whoever read our output has left
        return EXIT_FAILED
    except Exception as error:  # the edge of the command line: one line, no traceback
        logger.exception("%s failed", options.command)
        where = f" Details are in {log_file}." if log_file else ""
        return fail(EXIT_FAILED, f"{type(error).__name__}: {error}. This is a fault of the program.{where}")


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


class _Command(NamedTuple):
    """One subcommand: what its help says, its arguments, and what runs it and gives the exit code."""

    description: str
    add_arguments: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace, Launch], int]


_COMMANDS = {
    "train": _Command("Train clips of a capture.", add_train_arguments, train),
    "eval": _Command("Measure trained clips.", add_eval_arguments, evaluate),
    "render": _Command("Render a camera of trained clips.", add_render_arguments, render),
    "inspect": _Command(
        "Describe a capture, or what the trained clips of a project weigh.", add_inspect_arguments, inspect
    ),
    "gate": _Command(
        "Say what the gate decided in each trained clip, and mark regions that clips trained from now on take as "
        "static or as dynamic.",
        add_gate_arguments,
        gate,
    ),
    "doctor": _Command("Look at this machine.", add_doctor_arguments, doctor),
    "bench": _Command(
        "Measure the kernels on this machine: speed beside error, as a table and a picture.", add_bench_arguments, bench
    ),
    "ablate": _Command(
        "Train the method, its ablations and baselines on a capture, and write the table.", add_ablate_arguments, ablate
    ),
    "report": _Command(
        "Write one HTML page about a trained project, with its figures as PNG and numbers as CSV and JSON.",
        add_report_arguments,
        report,
    ),
}
