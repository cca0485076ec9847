"""Calibrating: a folder of plain videos on its way to a capture: its contents, the running job, the result."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from app.background.jobs import BackgroundJob, JobContext, Jobs
from app.calibration.job import CalibrationOutcome, CalibrationRequest, calibration_work, written
from app.project.opening.capture_report import refusal_of
from app.session.captures.calibration_page import CalibrationPage, CalibrationResult, VideoFacts
from app.session.captures.capture_commands import (
    CalibrateVideos,
    CalibrationCommand,
    KeepCalibration,
    LookAtVideos,
    StopCalibration,
)
from app.session.part import SessionPart
from app.status import JobStatus
from engine.calibration.calibrated import Calibration
from engine.calibration.videos import find_videos
from engine.capture.formats.capture_json import FILE
from engine.errors import EngineError, PreparationError


class Calibrating(SessionPart):
    """For one thread, which does not wait. Only the newest page is worked on.

    Attributes:
        page: Shown now; None for none.
        revision: Goes up whenever the page changes.
    """

    def __init__(self) -> None:
        self.page: CalibrationPage | None = None
        self.revision = 0
        self._jobs = Jobs()
        self._job: BackgroundJob | None = None
        self._failed: tuple[CalibrationRequest, Calibration] | None = None  # the last result, if nothing was written

    @property
    def progress(self) -> JobStatus | None:
        """How far the calibration is; None while none runs."""
        is_running = self.page is not None and self.page.state == "running"
        return self._job.context.status if self._job is not None and is_running else None

    def obey(self, command: CalibrationCommand) -> None:
        """Carry out a command."""
        match command:
            case LookAtVideos(folder=folder):
                self.look(folder)
            case CalibrateVideos(request=request):
                self.start(request)
            case KeepCalibration():
                self.keep()
            case StopCalibration():
                self.stop()

    def look(self, folder: Path) -> None:
        """Show a folder, and find out which cameras are in it."""
        self.close_page()
        self._show(CalibrationPage(folder))

        def work(context: JobContext) -> CalibrationPage:
            videos = find_videos(folder)
            cameras = tuple(VideoFacts(video.name, video.size, video.source.n_frames, video.fps) for video in videos)
            return CalibrationPage(folder, "asking", cameras, (folder / FILE).exists())

        self._start(work, self._show)

    def start(self, request: CalibrationRequest) -> None:
        """Calibrate."""
        if self.page is None or self.page.state == "running":
            return
        self._show(replace(self.page, state="running", failure=None))
        self._start(calibration_work(request), lambda outcome: self._take(request, outcome))

    def keep(self) -> None:
        """Write a calibration that has failed all the same, with all of its cameras in use."""
        if self.page is None or self._failed is None:
            return
        (request, calibration), self._failed = self._failed, None
        request = replace(request, keeps_doubtful=True)
        self._start(lambda context: written(calibration, request), lambda outcome: self._take(request, outcome))

    def _take(self, request: CalibrationRequest, outcome: CalibrationOutcome) -> None:
        if self.page is None:
            return
        calibration = outcome.calibration
        self._failed = None if outcome.is_written else (request, calibration)
        result = CalibrationResult(
            capture=outcome.capture,
            needs_links=outcome.needs_links,
            n_found=len(calibration.found.rig),
            missing=tuple(camera.name for camera in calibration.missing),
            has_doubts=any(calibration.found.doubts),
            failure="" if outcome.is_written else calibration.failure,
            lines=outcome.lines,
        )
        self._show(replace(self.page, state="done", result=result))

    def stop(self) -> None:
        """End the calibration; nothing was written. Options may be changed."""
        self._cancel()
        if self.page is not None and self.page.state == "running":
            self._show(replace(self.page, state="asking"))

    def close_page(self) -> None:
        """End the running job, and show nothing."""
        if self.page is not None:
            self._cancel()
            self._failed = None
            self._show(None)

    def poll(self) -> bool:
        """Take in finished work. Whether there was any."""
        return self._jobs.poll()

    @property
    def finished(self) -> tuple[object, ...]:
        """Differs whenever there is something else to show."""
        return self.revision, self.progress

    def close(self) -> None:
        """End the job."""
        self._jobs.close(timeout_s=3.0)

    def _start(self, work: Callable[[JobContext], Any], take: Callable[[Any], None]) -> None:
        self._job = self._jobs.start("Calibrating", work, take, self._fail)

    def _cancel(self) -> None:
        if self._job is not None:
            self._job.context.cancel()
            self._job = None

    def _show(self, page: CalibrationPage | None) -> None:
        self.page = page
        self.revision += 1

    def _fail(self, error: Exception) -> None:
        if self.page is None:
            return
        if not isinstance(error, EngineError):
            error = PreparationError(f"Something unexpected happened ({type(error).__name__}: {error}).")
        failure = replace(refusal_of(self.page.folder, error), videos=())
        self._show(replace(self.page, state="asking", failure=failure))
