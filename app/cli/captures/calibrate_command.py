"""clipgstream calibrate: from a folder of plain videos to a capture with calibrated cameras."""

from __future__ import annotations

import argparse

from app.calibration.job import CalibrationRequest, TimeLeft, run_calibration
from app.cli.arguments import EXIT_FAILED, EXIT_OK, add_follow_links, path_argument
from app.cli.terminal.progress import ProgressLine
from app.training.service import Launch
from engine.calibration.boards.board import read_board
from engine.calibration.options import LENSES, UPS, CalibrationOptions, KnownDistance
from engine.errors import CaptureError
from engine.progress import Progress
from engine.text import printable, shown


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream calibrate`."""
    command.add_argument(
        "videos", type=path_argument, help="folder with one video, or one folder of images, per camera"
    )
    command.add_argument(
        "--out",
        type=path_argument,
        metavar="CAPTURE",
        help="folder that becomes the capture (default: the folder of the videos); only capture.json is written",
    )
    command.add_argument(
        "--board",
        metavar="BOARD",
        help="calibrate by a board that all cameras film, such as charuco:7x5:0.04:0.03:4X4_50 (squares, side of a "
        "square and of a marker in metres, markers) or chessboard:9x6:0.03 (inner corners); see `clipgstream board`",
    )
    command.add_argument(
        "--recording",
        type=path_argument,
        metavar="VIDEOS",
        help="folder of what the same cameras filmed before or after: it becomes the capture",
    )
    command.add_argument(
        "--lens",
        choices=tuple(LENSES),
        default="simple",
        help="; ".join(f"{name}: {text}" for name, text in LENSES.items()) + " (default: simple)",
    )
    command.add_argument("--shared-lens", action="store_true", help="all cameras are the same model at the same zoom")
    command.add_argument(
        "--distance",
        nargs=3,
        metavar=("CAM", "CAM", "METRES"),
        help="a measured distance between two cameras, lens to lens: the scene gets its size from it",
    )
    command.add_argument(
        "--up",
        choices=tuple(UPS),
        default="floor",
        help="; ".join(f"{name}: {text}" for name, text in UPS.items()) + " (default: floor)",
    )
    command.add_argument(
        "--keep-doubtful",
        action="store_true",
        help="write capture.json even if matches contradict many cameras, and leave doubtful ones in use",
    )
    command.add_argument("--replace", action="store_true", help="replace an existing capture.json")
    add_follow_links(command)
    command.add_argument("--quiet", action="store_true", help="show no progress")


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream calibrate: find the cameras and write capture.json. Returns the exit code: 1 if places contradict."""
    board = None if options.board is None else read_board(options.board)
    chosen = CalibrationOptions(options.lens, options.shared_lens, _distance(options.distance), options.up, board)
    request = CalibrationRequest(
        options.videos,
        options.out,
        chosen,
        options.replace,
        options.keep_doubtful,
        options.follow_links,
        options.recording,
    )
    line, left, seen = ProgressLine(is_quiet=options.quiet), TimeLeft(), Progress("Starting", 0.0)

    def show() -> None:
        detail = "  ".join(filter(None, [seen.stage, seen.message, left.text(seen.done)]))
        line.update("Calibrating", seen.done, detail)

    def report(progress: Progress) -> None:
        nonlocal seen
        seen = progress
        show()

    outcome = run_calibration(request, report=report, alive=show)  # the time moves while nothing is reported
    line.finish()
    print(printable("\n".join(outcome.lines)))
    if not outcome.is_written:
        print("Nothing was written. --keep-doubtful writes capture.json anyway.")
        return EXIT_FAILED
    links = " --follow-links" if outcome.needs_links else ""
    print(printable(f"The capture is {outcome.capture}. Inspect it with: clipgstream inspect{links} {outcome.capture}"))
    return EXIT_OK


def _distance(words: list[str] | None) -> KnownDistance | None:
    """--distance as a value. Raises CaptureError when its last part is not a number."""
    if words is None:
        return None
    try:
        return KnownDistance(words[0], words[1], float(words[2]))
    except ValueError:
        raise CaptureError(
            f"--distance ends in {shown(words[2])}, which is not a number of metres.",
            hint="Write --distance CAM CAM METRES.",
        ) from None
