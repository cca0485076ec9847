"""From a folder of plain videos to calibrated cameras, by a child process: see engine.calibration.child.

Nothing is written but temporary files, and the folder of videos is only read.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np

from engine.calibration.calibrated import Calibration
from engine.calibration.options import CalibrationOptions
from engine.calibration.videos import MIN_CAMERAS, find_videos
from engine.children.folder import child_folder
from engine.children.kind import STALL_S, ChildFailed, ChildKind
from engine.children.process import run_child
from engine.errors import CaptureError, EngineError, PreparationError
from engine.progress import Progress, ReportProgress

MIN_BOARD_CAMERAS = 2
FOLDER_PREFIX = "clipgstream-calibration-"


class CalibrationJob(msgspec.Struct, frozen=True):
    """The child's job; see `calibrate`. scratch: A folder for its files."""

    folder: Path
    options: CalibrationOptions
    follow_links: bool
    scratch: Path


CALIBRATING: ChildKind[CalibrationJob, Progress, Calibration] = ChildKind(
    place="engine.calibration.calibrate:CALIBRATING",
    work="engine.calibration.child:main",
    what="The calibration process",
    job=CalibrationJob,
    result=Calibration,
    stall_s=STALL_S,
    is_spreading=True,
)


def calibrate(
    folder: Path,
    options: CalibrationOptions,
    *,
    follow_links: bool = False,
    report: ReportProgress,
    alive: Callable[[], None] = lambda: None,
    stall_s: float = STALL_S,
) -> Calibration:
    """Find the cameras of a folder of plain videos.

    Args:
        folder: One video, or one folder of images, per camera.
        options: Lens, scale, up.
        follow_links: Whether links in the folder may lead out of it.
        report: Called with stage and share of the whole that is done. An error raised by it ends the work.
        alive: Called several times a second; what it raises ends the work within a moment.
        stall_s: Seconds without any work of the child after which it is taken for hung.
    Raises:
        CaptureError: The folder has no videos that can be used, or an option names a camera that is not there.
        PreparationError: The cameras could not be found from these videos; says what helps.
        DiskError: There is no room for temporary files.
    """
    names = [video.name for video in find_videos(folder, follow_links=follow_links, least=least_cameras(options))]
    check_distance(options, names, folder)
    with child_folder(FOLDER_PREFIX, what="Temporary files of the calibration") as scratch:
        job = CalibrationJob(folder.absolute(), options, follow_links, scratch)
        report(Progress("Starting", 0.0))
        try:
            return run_child(CALIBRATING, job, report=report, alive=alive, stall_s=stall_s, folder=scratch)
        except ChildFailed as error:
            raise PreparationError(f"{error}.", hint="Try again; see the log for details.", path=folder) from error
        except EngineError as error:
            error.path = folder
            raise


def least_cameras(options: CalibrationOptions) -> int:
    """Cameras that are needed: a board says for two what pictures alone say for three."""
    return MIN_CAMERAS if options.board is None else MIN_BOARD_CAMERAS


def check_distance(options: CalibrationOptions, names: list[str], folder: Path) -> None:
    """Refuse a distance between cameras that are not there, between a camera and itself, or not above 0."""
    known = options.distance
    if known is None:
        return
    hint = f"Cameras are {', '.join(names[:8])}{' and more' if len(names) > 8 else ''}."
    for name in (known.first, known.second):
        if name not in names:
            raise CaptureError(f"Camera '{name}' does not exist.", hint=hint, path=folder)
    if known.first == known.second or not (np.isfinite(known.metres) and known.metres > 0):
        text = f"The distance from {known.first} to {known.second} is {known.metres:g} m."
        raise CaptureError(text, hint="Give a distance above 0 between two cameras.", path=folder)
