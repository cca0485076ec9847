"""CaptureOpening: a folder before a project is made of it, as the window shows it: report, pictures, forecast."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path

from app.background.jobs import JobCancelled, JobContext, Jobs
from app.background.latest import LatestWorker
from app.plan.opening_forecast import forecast_opening
from app.plan.speed import known_step_time, step_time
from app.playback.capture_pictures import downsized
from app.playback.modes.arrays import Picture
from app.project.opening.capture_report import RefusedFolder, refusal_of, report_of
from app.project.opening.opening_answers import LastAnswers, OpeningAnswers, default_answers
from app.session.part import SessionPart
from app.session.questions import OpeningPage
from app.status import OpeningForecast
from engine.capture.capture import Capture
from engine.doctor.finding import Finding, in_order
from engine.errors import EngineError
from engine.training.plan.plan import StepSizes

PICTURE_WIDTH_PX = 320
QUICK, TIMED = "quick", "timed"
AGAIN_S = 3.0
"""Pause before steps that could not be timed are tried again."""


@dataclass(frozen=True, slots=True)
class _Forecast:
    """Everything that a forecast depends on."""

    page: int
    answers: OpeningAnswers
    is_timed: bool
    attempt: int
    capture: Capture = field(compare=False)
    folder: Path = field(compare=False)


class CaptureOpening(SessionPart):
    """For one thread, which does not wait.

    Attributes:
        page: The questions; None while there are none.
        refused: The folder that does not open, and why; None while there is none.
        pictures: Small ones of first frames, by camera.
        findings: Of the capture doctor, in the numbers alone, the worst first; None until known.
        revision: Goes up whenever any of these changes.

    Args:
        can_measure: Whether steps may be timed for a forecast.
    """

    def __init__(self, *, can_measure: bool) -> None:
        self.page: OpeningPage | None = None
        self.refused: RefusedFolder | None = None
        self.pictures: dict[int, Picture] = {}
        self.findings: tuple[Finding, ...] | None = None
        self.revision = 0
        self._can_measure, self._page_number = can_measure, 0
        self._attempt, self._again_s = 0, 0.0
        self._capture: Capture | None = None
        self._jobs = Jobs()
        self._worker: LatestWorker[_Forecast, OpeningForecast] = LatestWorker("opening forecast", self._forecast)
        self._worker.active_lane = QUICK
        self._last: OpeningForecast | None = None

    # ---- the page

    def ask(self, capture: Capture, last: LastAnswers, *, is_new_project: bool, folder: Path = Path()) -> None:
        """Show a capture. It belongs to this object until it is taken or the page is closed.

        Args:
            folder: See OpeningPage.
        """
        self.close_page()
        answers = default_answers(capture, last)
        self._capture = capture
        self.page = OpeningPage(report_of(capture), answers, is_new_project, capture.follow_links, folder)
        self.revision += 1
        page, pictures = self.revision, self.pictures
        self._page_number = page

        def read(context: JobContext) -> None:
            from engine.doctor.quick import check_numbers  # loading it takes a moment

            findings = tuple(in_order(check_numbers(capture)))
            if self._page_number == page:
                self.findings = findings
            small = capture.resized(min(1.0, PICTURE_WIDTH_PX / int(capture.native_rig.image_sizes[:, 0].max())))
            try:
                for camera in range(len(small.rig)):
                    context.report(camera / len(small.rig))
                    image = downsized(small.frame(camera, 0), PICTURE_WIDTH_PX)
                    pictures[camera] = Picture(image, ("opening", page, camera))
            except EngineError as error:  # training reports it again; the page needs no pictures
                raise JobCancelled from error
            finally:
                small.close()

        self._jobs.start("Pictures", read, lambda _: None, lambda _: None)

    def refuse(self, path: Path, error: EngineError) -> None:
        """Show why a folder does not open."""
        self.close_page()
        self.refused = refusal_of(path, error)
        self.revision += 1

    def take(self, path: Path) -> Capture | None:
        """The open capture of this folder, which is the caller's from now on; None where it is another one."""
        if self._capture is None or self._capture.path != path:
            return None
        taken, self._capture = self._capture, None
        return taken

    def close_page(self) -> None:
        """Ask nothing any more."""
        if self.page is None and self.refused is None:
            return
        self._jobs.cancel()
        if self._capture is not None:
            self._capture.close()
        self.page = self.refused = self._capture = self._last = None
        self.findings = None
        self.pictures = {}
        self._page_number = 0
        self.revision += 1
        self._worker.forget()

    # ---- the forecast

    def forecast(self, answers: OpeningAnswers) -> tuple[OpeningForecast | None, bool]:
        """The time and memory that training with these answers takes, and whether it is final. Requests it if needed.

        Until then: the forecast of earlier answers, or None.
        """
        if self._capture is None:
            return self._last, False
        is_final = True
        for lane in (QUICK, TIMED) if self._can_measure else (QUICK,):
            folder = Path() if self.page is None else self.page.folder
            request = _Forecast(self._page_number, answers, lane == TIMED, self._attempt, self._capture, folder)
            newest = self._worker.newest_in(lane)
            if newest is not None and newest[0] == request:
                self._last = newest[1]
                if lane == TIMED and newest[1].reference_s is None:  # kernels are being compiled, at the first start
                    is_final = False
                    if time.monotonic() > self._again_s:
                        self._attempt, self._again_s = self._attempt + 1, time.monotonic() + AGAIN_S
            elif not self._worker.has_failed(request):
                is_final = False
                self._worker.request(request, lane=lane)
        return self._last, is_final

    def problem(self, answers: OpeningAnswers) -> str:
        """The reason why these answers cannot make a project; empty where they can."""
        if self.page is None:
            return ""
        n_cameras = len(self.page.report.cameras)
        if n_cameras - len(answers.holdout) < 2:
            return "Fewer than two cameras are left for training."
        if self.page.report.needs_fit and answers.fit is None:
            return "Say whether frames were scaled or cropped."
        return ""

    def poll(self) -> bool:
        """Take in finished work. Whether there was any."""
        return self._jobs.poll()

    @property
    def finished(self) -> tuple[object, ...]:
        """Differs whenever there is something else to show."""
        done = tuple(None if (found := self._worker.newest_in(lane)) is None else found[0] for lane in (QUICK, TIMED))
        return self.revision, len(self.pictures), self.findings is None, done

    def close(self) -> None:
        """End the threads."""
        self.close_page()
        self._jobs.close()
        self._worker.close()

    def _forecast(self, request: _Forecast) -> OpeningForecast:
        def timed(sizes: StepSizes, phase: str) -> float | None:
            return step_time(sizes, phase, lambda: not self._worker.is_closed)

        step_time_s = timed if request.is_timed else known_step_time
        return forecast_opening(request.capture, request.answers, step_time=step_time_s, place=request.folder)
