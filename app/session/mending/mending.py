"""Mending: a seam, or a stretch with flicker, on its way to being mended: the question, the job, the result."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from app.background.jobs import BackgroundJob, JobContext, Jobs
from app.document.project_document import ProjectDocument
from app.mending.mend_project import MendOutcome, mend_work
from app.mending.request import MendRequest
from app.playback.timeline import Timeline
from app.project.allowed_changes import is_other_cut
from app.project.mends.in_place import as_cut_now, take_back, version_before
from app.project.opening.opened_project import OpenedProject
from app.session.clips.clip_commands import CompareVersion
from app.session.clips.comparing import show_version
from app.session.mending.mend_commands import (
    AskMend,
    CloseMend,
    CompareMended,
    MendCommand,
    RevertMend,
    StartMend,
    StopMend,
)
from app.session.mending.mend_page import MendPage
from app.session.part import SessionPart
from app.session.training.live_training import LiveTraining
from app.status import CAPTURED, JobStatus, Overlays
from engine.errors import EngineError, ProjectError


class ProjectMending(SessionPart):
    """For one thread, which does not wait.

    Args:
        live: Of the session: the training, and the clips on disk.
        overlays: Gives those of the view in use, where an earlier version is compared with.

    Attributes:
        page: Shown now; None for none.
        revision: Goes up whenever the page changes.
    """

    def __init__(self, live: LiveTraining, overlays: Callable[[], Overlays]) -> None:
        self.page: MendPage | None = None
        self.revision = 0
        self._live, self._overlays = live, overlays
        self._jobs = Jobs()
        self._job: BackgroundJob | None = None
        self._stopped: tuple[int, ...] = ()
        self._opened: OpenedProject | None = None

    def open(self, opened: OpenedProject) -> None:
        """Take up a project, or the same one with other settings."""
        if self._opened is None or self._opened.generation != opened.generation:
            self._close_page()
        elif self._opened.clips != opened.clips and self.page is not None and self.page.state == "asking":
            self._close_page()  # its clips are numbered otherwise now
        self._opened = opened

    def reopen(self, opened: OpenedProject) -> None:
        """The same project is open, with other settings."""
        self.open(opened)

    @property
    def progress(self) -> JobStatus | None:
        """How far the mending is; None while none runs."""
        is_running = self.page is not None and self.page.state == "running"
        return self._job.context.status if self._job is not None and is_running else None

    @property
    def is_busy(self) -> bool:
        """Whether something is being mended."""
        return self.page is not None and self.page.state == "running"

    def check_idle(self) -> None:
        """Check that nothing is mended, so that clips may be cut otherwise.

        Raises:
            ProjectError: Something is.
        """
        if self.is_busy:
            raise ProjectError("Clips are being mended.", hint="Wait for it, or stop it first.")

    def check_change(self, before: ProjectDocument, after: ProjectDocument) -> None:
        """Check that nothing is mended where clips are cut otherwise. Raises ProjectError."""
        if is_other_cut(before.settings, after.settings):
            self.check_idle()

    def apply(self, command: MendCommand, timeline: Timeline) -> None:
        """Carry out a command.

        Raises:
            ProjectError: It cannot be done; states the cause.
        """
        match command:
            case AskMend(after=after, frames=frames):
                self._ask(MendRequest(after, frames))
            case StartMend(method=method):
                self._start_mending(method)
            case StopMend():
                self._stop()
            case CompareMended():
                self._compare(timeline)
            case RevertMend():
                self._revert()
            case CloseMend():
                self._close_page()

    # ---------------------------------------------------------------- asking

    def _ask(self, request: MendRequest) -> None:
        opened = self._checked()
        if self.is_busy:
            raise ProjectError("Mending is already running.", hint="Wait for it, or stop it.")
        self._close_page()
        stretch = request.stretch(opened.clips)
        page = MendPage(request, stretch.words, stretch.pairs[0], stretch.clip_indices, why_not=self._why_not(request))
        self._show(replace(page, estimate_s=self._estimate(stretch.clip_indices)))

    def _why_not(self, request: MendRequest) -> str:
        opened, service = self._checked(), self._live.service
        stretch = request.stretch(opened.clips)
        project = opened.project
        if not project.is_writable:
            return "The project is open read-only, because another program is training it."
        states = ["untrained" if service is None else service.catalog[i].state for i in stretch.clip_indices]
        not_ready = [index for index, state in zip(stretch.clip_indices, states, strict=True) if state != "trained"]
        if not_ready:
            return f"Clip {not_ready[0]} is not trained, or out of date. Train it first."
        if all(index == project.settings.reference_clip for index in stretch.clip_indices):
            return "These frames are in the reference clip, which cannot change because others inherit from it."
        config = project.settings.config()
        if config.independent or config.field != "per_clip":
            return "The clips of this project share nothing, or one field, so they cannot be mended."
        if self._live.is_busy_anywhere:
            return "A clip is being trained. Mend when it has ended."
        return ""

    def _estimate(self, clip_indices: tuple[int, ...]) -> float | None:
        """About as long as one of the clips took to be trained."""
        service = self._live.service
        known = [] if service is None else [service.catalog[index].seconds for index in clip_indices]
        return max((seconds for seconds in known if seconds is not None), default=None)

    # ---------------------------------------------------------------- the job

    def _start_mending(self, method: str) -> None:
        opened, page = self._checked(), self.page
        if page is None or page.state == "running":
            return
        reason = self._why_not(page.request)
        if reason:
            self._show(replace(page, why_not=reason))
            return
        self._end_comparing()
        request = MendRequest(page.request.after, page.request.frames, method)
        request.stretch(opened.clips)  # refuses a method that there is not
        self._show(MendPage(request, page.words, page.frame, page.clip_indices, "running", estimate_s=page.estimate_s))
        self._start(mend_work(opened.project, request), self._take)

    def _take(self, outcome: MendOutcome) -> None:
        for clip in outcome.record.clips:
            self._note_change(clip.clip_index)
        if self.page is not None:
            self._show(replace(self.page, state="done", record=outcome.record, number=outcome.number))

    def _stop(self) -> None:
        page = self.page
        if page is not None and page.state == "running":
            self._cancel()
            self._show(replace(page, state="asking"))

    # ---------------------------------------------------------------- the result

    def _compare(self, timeline: Timeline) -> None:
        page, opened = self.page, self._checked()
        if page is None or page.record is None or not page.record.clips:
            return
        if page.compared is not None:
            self._end_comparing()
            return
        clips, here = as_cut_now(opened.project, page.record).clips, timeline.clip
        chosen = next((one for one in clips if here is not None and one.clip_index == here.clip_index), clips[0])
        version = version_before(opened.project, chosen)
        if version is None:
            raise ProjectError(f"The version of clip {chosen.clip_index} from before it was mended is gone.")
        show_version(CompareVersion(chosen.clip_index, version), timeline, self._overlays())
        self._show(replace(page, compared=chosen.clip_index))

    def _end_comparing(self) -> None:
        if self.page is not None and self.page.compared is not None:
            overlays = self._overlays()
            overlays.compare, overlays.compare_with = "off", CAPTURED
            self._show(replace(self.page, compared=None))

    def _revert(self) -> None:
        page, opened = self.page, self._checked()
        if page is None or page.state != "done" or page.record is None or not page.record.has_helped:
            return
        self._end_comparing()
        record, project = as_cut_now(opened.project, page.record), opened.project

        def done(_: None) -> None:
            for clip in record.clips:
                self._note_change(clip.clip_index)
            if self.page is not None:
                self._show(replace(self.page, state="reverted"))

        self._start(lambda context: take_back(project, record), done)

    def _note_change(self, clip_index: int) -> None:
        if self._live.service is not None and clip_index < len(self._live.service.catalog):
            self._live.service.catalog.update(clip_index)

    # ---------------------------------------------------------------- the page and its job

    def poll(self) -> bool:
        """Take in finished work. Whether there was any."""
        has_ended = self._jobs.poll()
        if has_ended and self._stopped:  # it may have been too late
            for clip_index in self._stopped:
                self._note_change(clip_index)
            self._stopped = ()
        return has_ended

    @property
    def finished(self) -> tuple[object, ...]:
        """Differs whenever there is something else to show."""
        return self.revision, self.progress

    def close(self) -> None:
        """End the job."""
        self._jobs.close(timeout_s=3.0)

    def _start(self, work: Callable[[JobContext], Any], take: Callable[[Any], None]) -> None:
        self._job = self._jobs.start("ProjectMending", work, take, self._fail)

    def _fail(self, error: Exception) -> None:
        if self.page is None:
            return
        said = error.parts() if isinstance(error, EngineError) else (f"{type(error).__name__}: {error}", "")
        state = "asking" if self.page.state == "running" else self.page.state
        self._show(replace(self.page, state=state, failure=said[0], hint=said[1]))

    def _cancel(self) -> None:
        if self._job is not None:
            self._job.context.cancel()
            self._job, self._stopped = None, self.page.clip_indices if self.page is not None else ()

    def _close_page(self) -> None:
        if self.page is None:
            return
        if self.page.state == "running":
            self._cancel()
        self._end_comparing()
        self._show(None)

    def _show(self, page: MendPage | None) -> None:
        self.page = page
        self.revision += 1

    def _checked(self) -> OpenedProject:
        if self._opened is None:
            raise ProjectError("No capture is open.", hint="Open one first.")
        self._opened.capture.check_pictures()
        return self._opened
