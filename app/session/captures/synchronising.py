"""Synchronising: measures how far cameras of the open capture are ahead of each other; corrects it on request."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from app.background.jobs import BackgroundJob, JobContext, Jobs
from app.project.opening.opened_project import OpenedProject
from app.session.captures.capture_commands import ApplyOffsets, SynchronisationCommand, SynchroniseCameras
from app.session.captures.synchronisation_page import OffsetRow, SynchronisationPage
from app.session.part import SessionPart
from app.status import JobStatus
from engine.capture.capture import Capture
from engine.capture.writers.capture_json import write_corrections
from engine.errors import EngineError, ProjectError
from engine.progress import Progress
from engine.storage.files import disk_error
from engine.synchronisation.applying import corrections_for
from engine.synchronisation.synchronisation import Synchronisation


class Synchronising(SessionPart):
    """For one thread, which does not wait.

    Attributes:
        page: Shown now; None for none.
        revision: Goes up whenever the page changes.
    """

    def __init__(self) -> None:
        self.page: SynchronisationPage | None = None
        self.revision = 0
        self._jobs = Jobs()
        self._job: BackgroundJob | None = None
        self._capture: Capture | None = None
        self._opened: OpenedProject | None = None
        self._found: Synchronisation | None = None

    @property
    def progress(self) -> JobStatus | None:
        """How far the measurement is; None while none runs."""
        is_running = self.page is not None and self.page.state == "running"
        return self._job.context.status if self._job is not None and is_running else None

    def obey(self, command: SynchronisationCommand) -> None:
        """Carry out a command.

        Raises:
            ProjectError: No capture is open.
        """
        match command:
            case SynchroniseCameras():
                self.measure()
            case ApplyOffsets(target=target):
                self.apply(target)

    def open(self, opened: OpenedProject) -> None:
        """Another project is open."""
        self._opened = opened

    def reopen(self, opened: OpenedProject) -> None:
        """The same project is open, with other settings."""
        self.open(opened)

    def measure(self) -> None:
        """Measure the whole capture that is open, whichever of its frames are worked on.

        Raises:
            ProjectError: None is open.
        """
        opened = self._opened
        if opened is None:
            raise ProjectError("No capture is open.", hint="Open one first.")
        self.close_page()
        capture = self._capture = opened.capture.resized(opened.capture.scale)
        target = capture.path
        if opened.project.has_progress:  # the progress belongs to the capture as it is
            target = target.with_name(f"{target.name}-synchronised")
        self._show(SynchronisationPage(capture.path, fps=capture.fps, target=target))

        def work(context: JobContext) -> Synchronisation:
            from engine.synchronisation.estimating import synchronise  # numba, which the first picture does not need

            def report(progress: Progress) -> None:
                context.report(progress.done, " - ".join(filter(None, [progress.stage, progress.message])))

            return synchronise(capture, report=report)

        self._start(work, self._take)

    def apply(self, target: Path) -> None:
        """Write a capture with these offsets into a folder: the capture's own, or another one."""
        capture, found, page = self._capture, self._found, self.page
        if capture is None or found is None or page is None:
            return
        self._show(replace(page, failure=""))

        def work(context: JobContext) -> Path:
            is_own = target.absolute() == capture.path.absolute()
            try:
                target.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise disk_error(error, what="The folder", path=target) from error
            corrections = corrections_for(capture, found)
            return write_corrections(capture.layout, capture.path, corrections, target=None if is_own else target)

        def take(path: Path) -> None:
            if self.page is not None:
                self._show(replace(self.page, state="written", written=path.parent))

        self._start(work, take)

    def close_page(self) -> None:
        """End the running job, and show nothing."""
        if self.page is None:
            return
        if self._job is not None:
            self._job.context.cancel()
        if self._capture is not None:
            self._capture.close()
        self._job = self._capture = self._found = None
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
        self._jobs.close()

    def _start(self, work: Callable[[JobContext], Any], take: Callable[[Any], None]) -> None:
        self._job = self._jobs.start("Synchronising", work, take, self._fail)

    def _show(self, page: SynchronisationPage | None) -> None:
        self.page = page
        self.revision += 1

    def _take(self, found: Synchronisation) -> None:
        if self.page is None:
            return
        self._found = found
        rows = tuple(
            OffsetRow(
                name=camera.name,
                offset_frames=None if camera.source is None else camera.offset_frames,
                sigma_frames=camera.sigma_frames,
                confidence=camera.confidence,
                source=camera.source or "",
                is_sure=camera.is_sure,
            )
            for camera in found.cameras
        )
        self._show(
            replace(
                self.page,
                state="done",
                rows=rows,
                notes=tuple(f"{estimate.source}: {estimate.note}" for estimate in found.estimates),
                disagreements=tuple(one.text for one in found.disagreements),
                is_in_step=found.is_in_step,
                fps=found.fps,
            )
        )

    def _fail(self, error: Exception) -> None:
        if self.page is None:
            return
        said = str(error) if isinstance(error, EngineError) else f"{type(error).__name__}: {error}"
        self._show(replace(self.page, state="done", failure=said))
