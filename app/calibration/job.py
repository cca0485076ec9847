"""The job that turns a folder of plain videos into a capture: for the command line and, on a thread, for the window.

A window starts it with Jobs (app.background.jobs):

    jobs.start("Calibrating", calibration_work(request), on_done, on_error)

`on_done` gets a CalibrationOutcome, `on_error` the exception; the job's status has the share done and, as its message,
the stage with the time left. Job.context.cancel() ends the child process within a moment, and then nothing is written.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from app.background.jobs import JobCancelled, JobContext
from app.calibration.report import report_lines
from engine.calibration.calibrate import calibrate, least_cameras
from engine.calibration.calibrated import Calibration
from engine.calibration.options import CalibrationOptions
from engine.calibration.videos import common_length, common_rate, find_videos
from engine.capture.formats.capture_json import FILE
from engine.capture.layout.format_result import CameraEntry, Layout
from engine.capture.writers.capture_json import capture_document, write_capture_json
from engine.errors import CaptureError
from engine.progress import Progress, ReportProgress
from engine.text import duration_text

MIN_SHARE = 0.05
"""Before this share is done the time left is not reported: it would be a guess."""


@dataclass(frozen=True, slots=True)
class CalibrationRequest:
    """The request.

    Attributes:
        videos: Folder with one video, or one folder of images, per camera.
        out: Folder that becomes the capture; None for the folder of its videos. Only capture.json is written.
        recording: Folder of other videos of the same cameras, those of the capture, where `videos` show a board only.
        options: Lens, scale, up.
        is_replacing: Whether a capture.json that is there may be replaced.
        keeps_doubtful: Write it also where the calibration has failed, and leave doubtful cameras in use.
        follow_links: Whether links in the folder of the videos may lead out of it.
    """

    videos: Path
    out: Path | None = None
    options: CalibrationOptions = field(default_factory=CalibrationOptions)
    is_replacing: bool = False
    keeps_doubtful: bool = False
    follow_links: bool = False
    recording: Path | None = None

    @property
    def filmed(self) -> Path:
        """Folder of the videos that the capture consists of."""
        return self.recording or self.videos


@dataclass(frozen=True, slots=True)
class CalibrationOutcome:
    """The result.

    Attributes:
        capture: The folder to open.
        needs_links: Whether it has to be opened with follow_links, since its videos lie elsewhere.
        calibration: The figures.
        lines: The report in sentences, fit to be shown one below another.
        is_written: Whether there is a capture: not where matches contradict many cameras.
    """

    capture: Path
    needs_links: bool
    calibration: Calibration
    lines: tuple[str, ...]
    is_written: bool = True


def run_calibration(
    request: CalibrationRequest, *, report: ReportProgress, alive: Callable[[], None] = lambda: None
) -> CalibrationOutcome:
    """Calibrate and write capture.json, unless the calibration has failed; on this thread.

    Args:
        request: The request.
        report: Receives stage, share of the whole and detail.
        alive: Called several times a second; an exception from it ends the work.
    Raises:
        CaptureError: Bad input. PreparationError: No cameras could be found. DiskError: It could not be written.
    """
    check_target(request.out or request.filmed, is_replacing=request.is_replacing)
    if request.recording is not None:
        check_recording(request)
    calibration = calibrate(
        request.videos, request.options, follow_links=request.follow_links, report=report, alive=alive
    )
    return written(calibration, request)


def written(calibration: Calibration, request: CalibrationRequest) -> CalibrationOutcome:
    """The outcome of a calibration: a capture, unless it has failed and doubtful results are not kept.

    Raises:
        DiskError: It could not be written.
    """
    out, keeps = request.out or request.filmed, request.keeps_doubtful
    is_written = keeps or not calibration.failure
    needs_links = is_written and write_calibrated(
        calibration, request.filmed, out, keeps_doubtful=keeps, follow_links=request.follow_links
    )
    lines = tuple(report_lines(calibration, keeps_doubtful=keeps))
    return CalibrationOutcome(out, needs_links, calibration, lines, is_written)


def calibration_work(request: CalibrationRequest) -> Callable[[JobContext], CalibrationOutcome]:
    """`run_calibration` as the work of a Job."""

    def work(context: JobContext) -> CalibrationOutcome:
        def report(progress: Progress) -> None:
            context.report(progress.done, progress.stage)

        def alive() -> None:
            if context.is_cancelled:
                raise JobCancelled

        return run_calibration(request, report=report, alive=alive)

    return work


class TimeLeft:
    """Time taken, and time left from the share that is done; stages are weighed so that the share rises evenly.

    Args:
        clock: Seconds; tests bring their own.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._started_s = clock()

    def text(self, done: float) -> str:
        """As "0:40, about 2:00 left"; at the beginning and at the end only the time taken."""
        spent_s = self._clock() - self._started_s
        if not MIN_SHARE <= done < 1.0:
            return duration_text(spent_s)
        return f"{duration_text(spent_s)}, about {duration_text(spent_s * (1 - done) / done)} left"


def check_target(out: Path, *, is_replacing: bool) -> None:
    """Refuse a folder that has a capture.json already, or cannot be one, before any work is done.

    Raises:
        CaptureError: One of both; states which.
    """
    if out.exists() and not out.is_dir():
        raise CaptureError("This is a file; a capture is a folder.", hint="Name another folder.", path=out)
    if (out / FILE).exists() and not is_replacing:
        raise CaptureError(f"There is a {FILE} already.", hint="Name another folder, or allow replacing it.", path=out)


def check_recording(request: CalibrationRequest) -> None:
    """Refuse a recording that was not made by the cameras that are calibrated.

    Raises:
        CaptureError: Cameras are missing in it, or have pictures of another size; lists them.
    """
    assert request.recording is not None
    least = least_cameras(request.options)
    sizes = [
        {video.name: video.size for video in find_videos(folder, follow_links=request.follow_links, least=least)}
        for folder in (request.videos, request.recording)
    ]
    missing = [name for name in sizes[0] if name not in sizes[1]]
    if missing:
        raise CaptureError(
            f"{', '.join(missing)} of the videos to calibrate by {'are' if len(missing) > 1 else 'is'} not in the "
            "recording.",
            hint="Name the videos of each camera alike in both folders.",
            path=request.recording,
        )
    other = [name for name in sizes[0] if sizes[0][name] != sizes[1][name]]
    if other:
        (width, height), (wide, high) = sizes[1][other[0]], sizes[0][other[0]]
        raise CaptureError(
            f"{other[0]} has pictures of {width}x{height}, and of {wide}x{high} where it is calibrated.",
            hint="Film both at one size.",
            path=request.recording,
        )


def write_calibrated(
    calibration: Calibration, videos: Path, out: Path, *, keeps_doubtful: bool = False, follow_links: bool = False
) -> bool:
    """Write capture.json into `out`. Whether the capture has to be opened with follow_links.

    Args:
        calibration: Cameras whose places cannot be trusted are written as excluded.
        videos: Of the calibrated cameras.
        out: Folder that becomes the capture.
        keeps_doubtful: Leave those in use.
        follow_links: Whether links in the folder of the videos may lead out of it.
    Raises:
        DiskError: The folder cannot be written.
    """
    found = calibration.found
    sources = {video.name: video for video in find_videos(videos, follow_links=follow_links, least=1)}
    rig = found.rig
    used = [sources[name] for name in rig.names]
    entries = [
        CameraEntry(name, rig.Ks[row], rig.world_to_camera[row], used[row].size, used[row].source, found.lenses[row])
        for row, name in enumerate(rig.names)
    ]
    layout = Layout(format=FILE, cameras=tuple(entries), n_frames=common_length(used), fps=common_rate(used))
    out.mkdir(parents=True, exist_ok=True)
    document = capture_document(layout, out)
    document["up"] = [0.0, 0.0, 1.0]
    for camera, doubt in zip(document["cameras"], found.doubts, strict=True):
        if doubt and not keeps_doubtful:
            camera["is_excluded"] = True
    write_capture_json(out, document)
    root = os.path.abspath(out)
    return follow_links or os.path.commonpath((os.path.abspath(videos), root)) != root
