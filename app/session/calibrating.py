"""Calibrating: a folder of plain videos on its way to a capture: what is in it, the job that runs, what came of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from app.background.jobs import Job, JobContext, Jobs
from app.calibration.job import CalibrationRequest, calibration_work
from app.project.capture_report import refusal_of
from app.session.calibration_page import CalibrationPage, CalibrationResult, VideoFacts
from app.status import JobStatus
from engine.calibration.videos import find_videos
from engine.capture.formats.capture_json import FILE
from engine.errors import EngineError, PreparationError


class Calibrating:
    """For one thread, which does not wait. Only the newest page is worked on.

    Attributes:
        page: What is shown; None while nothing is.
        revision: Goes up when the page is another.
    """

    def __init__(self) -> None:
        self.page: CalibrationPage | None = None
        self.revision = 0
        self._jobs = Jobs()
        self._job: Job | None = None

    @property
    def progress(self) -> JobStatus | None:
        """How far the calibration is; None while none runs."""
        is_running = self.page is not None and self.page.state == "running"
        return self._job.context.status if self._job is not None and is_running else None

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
        calibrate = calibration_work(request)

        def work(context: JobContext) -> CalibrationResult:
            outcome = calibrate(context)
            found = outcome.calibration.found
            return CalibrationResult(
                capture=outcome.capture,
                needs_links=outcome.needs_links,
                n_found=len(found.rig),
                missing=tuple(camera.name for camera in outcome.calibration.missing),
                lines=outcome.lines,
            )

        def take(result: CalibrationResult) -> None:
            if self.page is not None:
                self._show(replace(self.page, state="done", result=result))

        self._start(work, take)

    def stop(self) -> None:
        """End the calibration; nothing was written. Options may be changed."""
        self._cancel()
        if self.page is not None and self.page.state == "running":
            self._show(replace(self.page, state="asking"))

    def close_page(self) -> None:
        """End what runs, and show nothing."""
        if self.page is not None:
            self._cancel()
            self._show(None)

    def poll(self) -> bool:
        """Take in what was finished. Whether anything was."""
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
