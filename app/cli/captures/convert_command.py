"""clipgstream convert: a capture written anew for another program, or as capture.json."""

from __future__ import annotations

import argparse

from app.cli.arguments import EXIT_OK, add_follow_links, path_argument
from app.cli.terminal.progress import ProgressLine, row_progress
from app.training.service import Launch
from engine.capture.capture import open_capture
from engine.capture.writers.conversion import TARGETS, convert
from engine.capture.writers.frame_files import FRAMES


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream convert`."""
    command.add_argument("capture", type=path_argument, help="capture folder in any layout")
    command.add_argument("--to", required=True, choices=TARGETS, help="layout to write")
    command.add_argument("--out", required=True, type=path_argument, metavar="DIR", help="new folder")
    command.add_argument(
        "--frames",
        choices=FRAMES,
        default="none",
        help="leave frames where they are, link to them, copy them, or decode them into PNG files (default: none)",
    )
    command.add_argument("--binary", action="store_true", help="with --to colmap: binary files instead of text")
    command.add_argument("--quiet", action="store_true", help="show no progress")
    add_follow_links(command)


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream convert: write a capture in another layout. Returns the exit code."""
    capture = open_capture(options.capture, follow_links=options.follow_links)
    line = ProgressLine(is_quiet=options.quiet)
    progress = row_progress(line, "Writing frames")
    done = convert(
        capture.layout,
        options.out,
        options.to,
        frames=options.frames,
        is_binary=options.binary,
        report=lambda n_done, n_all: progress(n_done, n_all, None),
    )
    capture.close()
    line.finish()
    for said in done.lines:
        line.say(f"Note: {said}")
    line.say(f"{len(capture.rig)} cameras, {capture.n_frames} frames in {done.folder}")
    return EXIT_OK
