"""CaptureDoctor: has the open capture examined in a process, keeps the findings, and writes corrections.

The process opens the capture once more, so that it does not compete with the window's decoding while somebody scrubs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from app.background.jobs import BackgroundJob, JobContext, Jobs
from app.background.latest import LatestWorker
from app.project.opening.opened_project import OpenedProject
from app.session.captures.capture_commands import CorrectCapture, DoctorCommand, ExamineCapture, StopExamining
from app.session.captures.doctor_status import DoctorStatus
from app.session.examining_process import examine_apart
from app.session.notices import Notices
from app.session.part import SessionPart
from app.session.projects.project_commands import OpenCapture
from app.session.questions import CorrectionQuestion
from engine.capture.capture import Capture
from engine.capture.writers.capture_json import Corrections, write_corrections
from engine.doctor.finding import Finding
from engine.progress import ReportProgress

if TYPE_CHECKING:  # loading the doctor takes a second: that is left to the thread
    from engine.doctor.doctor import Diagnosis

NAME = "Capture doctor"


class CaptureDoctor(SessionPart):
    """For one thread, which does not wait.

    Args:
        jobs, notices: Of the session.
        reopen: Takes the command that opens a corrected capture.

    Attributes:
        run: Examines a capture, on a thread that may wait; tests bring their own.
    """

    def __init__(self, jobs: Jobs, notices: Notices, reopen: Callable[[OpenCapture], None]) -> None:
        self._jobs, self._notices, self._reopen = jobs, notices, reopen
        self.run: Callable[[Capture, ReportProgress], Diagnosis] = examine_apart
        self._status = DoctorStatus()
        self._opened: OpenedProject | None = None
        self._job: BackgroundJob | None = None
        self._n_opened = 0
        self._quick: LatestWorker[int, tuple[tuple[Finding, ...], int]] = LatestWorker("quick look", self._look_quickly)

    @property
    def finished(self) -> object:
        """Another value whenever something was found without being examined."""
        return None if self._quick.newest is None else self._quick.newest[0]

    @property
    def status(self) -> DoctorStatus:
        """As of now."""
        newest = self._quick.newest
        if newest is not None and newest[0] == self._n_opened and self._status.memory_bytes == 0:
            findings, n_bytes = newest[1]
            self._status = replace(self._status, memory_bytes=n_bytes)
            if self._status.diagnosis is None:
                self._status = replace(self._status, findings=findings, revision=self._status.revision + 1)
        if self._job is None:
            return self._status
        return replace(self._status, state="running", progress=self._job.context.status)

    def open(self, opened: OpenedProject) -> None:
        """Another capture, or the same one with other settings, is open now."""
        is_same = self._opened is not None and self._opened.capture.fingerprint == opened.capture.fingerprint
        is_same = is_same and self._opened is not None and self._opened.capture.path == opened.capture.path
        self._opened = opened
        if is_same:
            return
        self.stop()
        self._status = DoctorStatus(revision=self._status.revision + 1)
        self._n_opened += 1
        self._quick.request(self._n_opened)

    def _look_quickly(self, n_opened: int) -> tuple[tuple[Finding, ...], int]:
        """Findings in the numbers alone, and the memory that examining takes."""
        from engine.doctor.memory import memory_bytes
        from engine.doctor.quick import quick_findings

        opened = self._opened
        return ((), 0) if opened is None else (tuple(quick_findings(opened.capture)), memory_bytes(opened.capture))

    def close(self) -> None:
        """The program ends."""
        self.stop()
        self._quick.close()

    def obey(self, command: DoctorCommand) -> CorrectionQuestion | None:
        """Carry out a command. Returns the question to answer first, if any."""
        match command:
            case ExamineCapture():
                self.examine()
            case StopExamining():
                self.stop()
            case CorrectCapture(corrections=corrections, words=words, is_confirmed=False):
                return self.question(corrections, words)
            case CorrectCapture(corrections=corrections):
                self.correct(corrections)
        return None

    def examine(self) -> None:
        """Begin, unless it is at it already."""
        if self._opened is None or self._job is not None:
            return
        capture = self._opened.capture
        capture.check_pictures()

        def work(context: JobContext) -> Diagnosis:
            return self.run(capture, lambda progress: context.report(progress.done, progress.message))

        def done(diagnosis: Diagnosis) -> None:
            if job is self._job:
                self._job = None
                revision = self._status.revision + 1
                self._status = replace(
                    self._status, state="done", findings=diagnosis.findings, diagnosis=diagnosis, revision=revision
                )

        def failed(error: Exception) -> None:
            if job is self._job:
                self._job = None
            self._notices.add_failure("The capture cannot be examined", error)

        job = self._job = self._jobs.start(NAME, work, done, failed)

    def stop(self) -> None:
        """Give up the running examination; earlier findings stay."""
        if self._job is not None:
            self._job.context.cancel()
            self._job = None

    def question(self, corrections: Corrections, words: str) -> CorrectionQuestion | None:
        """The question before corrections are written; None where nothing is open."""
        if self._opened is None:
            return None
        project = self._opened.project
        return CorrectionQuestion(
            capture=str(self._opened.capture.path),
            words=words,
            corrections=corrections,
            project=str(project.folder),
            has_progress=project.has_progress,
        )

    def correct(self, corrections: Corrections, target: Path | None = None) -> None:
        """Write corrections and open the capture as a new project."""
        if self._opened is None:
            return
        capture = self._opened.capture

        def work(context: JobContext) -> Path:
            context.report(0.0, "writing capture.json")
            return write_corrections(capture.layout, capture.path, corrections, target=target).parent

        def done(folder: Path) -> None:
            follow_links = capture.follow_links or target is not None
            self._reopen(OpenCapture(folder, is_new_project=True, follow_links=follow_links))

        def failed(error: Exception) -> None:
            self._notices.add_failure("The correction could not be written", error)

        self._jobs.start("Correcting the capture", work, done, failed)
