"""Composition root and argument routing. Nothing here imports torch, GL or a window before it is known to be needed."""

from __future__ import annotations

import argparse
import logging
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from app.background.logs import PrintableFormatter, start_logging
from app.cli.arguments import PlainParser, add_backend, add_follow_links, parse, path_argument, suggestion
from app.cli.commands import COMMANDS
from app.cli.installing.completion import SHELLS, completion_script
from engine.assets import asset_path
from engine.backends.table import AUTO, choose_backend
from engine.errors import ProjectError
from engine.kernels.cache import use_kernel_cache
from engine.own_modules import program_version
from ui.style.ui_scale import parse_scale

if TYPE_CHECKING:
    from app.project.opening.opened_project import OpenedProject
    from app.session.training.cluster_joining import ClusterConnection

WITH_WINDOW = {
    "sample": "open the sample capture that comes with the program, as a path would be",
    "demo": "train the first two clips, then write figures, a picture of the window and a video",
    "completion": "print a script with which bash, zsh or fish completes this command line",
}
"""Commands that belong to the window's side of the program, beside those of app.cli.commands."""
SWITCH_INTERVAL_S = 0.0005
"""How long another thread may keep the interpreter from the window's. A frame asks for it some twenty times, and the
default of 5 ms adds up to a visible stall while a thread imports what draws."""


def has_display() -> bool:
    """Is there a desktop to open a window on? Windows and macOS always have one."""
    if not sys.platform.startswith("linux"):
        return True
    return bool(os.environ.get("DISPLAY"))


def build_parser() -> PlainParser:
    """Arguments of the window and of the headless demo; the other commands have their own."""
    parser = PlainParser(
        prog="clipgstream",
        description="View, train and replay dynamic captures clip by clip.",
        epilog="without a window, each with its own --help:\n"
        + "\n".join(f"  clipgstream {name:<8} {summary}" for name, summary in _summaries().items()),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("path", nargs="?", type=path_argument, help="capture or project folder to open")
    add_follow_links(parser)
    parser.add_argument("--read-only", action="store_true", help="open the project read-only")
    parser.add_argument("--size", type=_parse_size, metavar="WxH", help="window size in pixels, for example 1440x900")
    parser.add_argument(
        "--ui-scale",
        type=parse_scale,
        default=argparse.SUPPRESS,  # then it is as it was chosen before
        metavar="SCALE",
        help="interface size: auto, or 75%% to 250%%",
    )
    add_backend(parser)
    parser.add_argument("--verbose", action="store_true", help="log more detail")
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version of the program and exit")
    return parser


class _Version(argparse.Action):
    """As argparse's own, but asked for the version when it is wanted only: that takes a while."""

    def __call__(self, parser: argparse.ArgumentParser, *rest: object) -> None:
        sys.stdout.write(f"clipgstream {program_version()}\n")
        parser.exit()


def _summaries() -> dict[str, str]:
    return {name: command.summary for name, command in COMMANDS.items()} | WITH_WINDOW


def build_demo_parser() -> PlainParser:
    """Arguments of the headless job."""
    parser = PlainParser(
        prog="clipgstream demo",
        description="Train the first two clips without a window, then write a picture of the window and a video.",
    )
    parser.add_argument(
        "path", nargs="?", type=path_argument, default=None, help="capture folder (default: the sample)"
    )
    parser.add_argument(
        "--out", type=path_argument, default=Path("demo_output"), help="folder for the results (default: demo_output)"
    )
    parser.add_argument("--quick", action="store_true", help="only a few steps, to check that every part works")
    add_backend(parser)
    return parser


def build_completion_parser() -> PlainParser:
    """Arguments of `clipgstream completion`."""
    summary = WITH_WINDOW["completion"]
    parser = PlainParser(prog="clipgstream completion", description=f"{summary[0].upper()}{summary[1:]}.")
    parser.add_argument("shell", choices=SHELLS, help="the shell that is to read it")
    return parser


def all_parsers() -> dict[str, PlainParser]:
    """Parsers by command, that of the window under "". Imports every command."""
    from app.cli.cli import parsers_of_commands

    own = {"": build_parser(), "sample": build_parser(), "demo": build_demo_parser()}
    return own | {"completion": build_completion_parser()} | parsers_of_commands()


def main(argv: Sequence[str] | None = None) -> int:
    """Route to a subcommand, the demo, or the window.

    Returns:
        Process exit code: 0 done, 2 bad input, other values from the subcommands.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    if arguments and arguments[0] in COMMANDS:
        from app.cli.cli import main as run_command
        from app.evaluation.speed.window_drawing import draw_with

        draw_with("ui.frame_rate")
        return int(run_command(arguments) or 0)
    if arguments and arguments[0] == "demo":
        use_kernel_cache()
        demo_parser = build_demo_parser()
        demo_options = demo_parser.parse_args(arguments[1:])
        _choose_backend(demo_parser, demo_options)
        return _run_demo(demo_options)
    if arguments and arguments[0] == "completion":
        shell = build_completion_parser().parse_args(arguments[1:]).shell
        sys.stdout.write(completion_script(shell, all_parsers(), _summaries()))
        return 0
    if arguments and arguments[0] == "sample":
        arguments[0] = str(asset_path("sample"))
    parser = build_parser()
    mistake = _mistyped_command(arguments)
    if mistake:
        parser.error(mistake)
    options = parse(parser, arguments)
    _choose_backend(parser, options)
    use_kernel_cache()
    level = logging.DEBUG if options.verbose else logging.INFO
    start_logging(level=level)
    if not has_display():  # the headless job says in the terminal what it does; records go to the log file alone
        demo_arguments = [] if options.path is None else [str(options.path)]
        return _run_demo(build_demo_parser().parse_args(demo_arguments))
    logging.basicConfig(level=level)
    for handler in logging.getLogger().handlers:
        handler.setFormatter(PrintableFormatter("%(levelname)s %(message)s"))
    return _run_window(options)


def _choose_backend(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    try:
        choose_backend(getattr(options, "backend", AUTO))
    except ProjectError as error:
        parser.error(str(error).rstrip("."))


def _mistyped_command(arguments: Sequence[str]) -> str:
    """The message where the first argument was most likely meant as a command; a path that exists is always a path."""
    word = arguments[0] if arguments else ""
    if not word or word.startswith("-") or os.path.lexists(word):
        return ""
    near = suggestion(word, _summaries())
    is_word = not os.path.dirname(word) and len(arguments) > 1 and not arguments[1].startswith("-")
    said = f"'{word}' is neither a command nor a file or folder"
    return f"{said}.{near}" if near else said if is_word else ""


def _run_demo(options: argparse.Namespace) -> int:
    from ui.shell.demo import run_demo

    return run_demo(options.path or asset_path("sample"), options.out, quick=options.quick)


def _parse_size(text: str) -> tuple[int, int]:
    width, _, height = text.lower().partition("x")
    if not (width.isdigit() and height.isdigit() and int(width) > 0 and int(height) > 0):
        raise argparse.ArgumentTypeError(f"'{text}' is not a size; write WIDTHxHEIGHT, for example 1440x900")
    return int(width), int(height)


def _run_window(options: argparse.Namespace) -> int:
    from ui.shell import no_window

    try:
        return _serve_window(options)
    except Exception as error:
        why = no_window.reason(error)
        if not why:
            raise
        logging.getLogger(__name__).debug("no window", exc_info=True)
        return no_window.tell(why)


def _join_cluster(address: str, opened: OpenedProject) -> ClusterConnection:
    from app.cluster.joined import JoinedCluster  # Ray, which most never need
    from app.project.clips.clip_catalog import ClipCatalog

    catalog = ClipCatalog(opened.project, len(opened.clips))
    return JoinedCluster(address, opened.project, opened.capture, opened.clips, catalog)


def _serve_window(options: argparse.Namespace) -> int:
    import pyglet

    sys.setswitchinterval(SWITCH_INTERVAL_S)
    pyglet.options.shadow_window = False  # no hidden second context
    # Sizes are pixels of the screen, of which ui.style.ui_scale makes units; on macOS they are the system's points.
    pyglet.options.dpi_scaling = "stretch" if sys.platform == "darwin" else "real"
    from app.project.opening.project_choices import ProjectChoices
    from app.session.projects.preferences import PreferencesFile
    from app.session.projects.project_commands import OpenCapture
    from app.session.projects.window_memory import read_window_memory
    from app.session.session import Session
    from ui.shell.window import StudioWindow

    width, height = options.size or (None, None)
    memory, preferences = read_window_memory(), PreferencesFile()
    if "backend" not in options:
        preferences.values.choose_backend()
    if "ui_scale" in options:
        memory.ui_scale = options.ui_scale
    session = Session(connect=_join_cluster)
    try:
        window = StudioWindow(session, width=width, height=height, memory=memory, preferences=preferences)
    except BaseException:
        session.close()
        raise
    try:
        if options.path is not None:
            choices = ProjectChoices(is_read_only=options.read_only)
            session.dispatch(OpenCapture(options.path, follow_links=options.follow_links, choices=choices))
        window.run()
    finally:
        window.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
