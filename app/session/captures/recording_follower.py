"""RecordingFollower: the capture of the open project grows while it is recorded, and its clips are trained at once."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

from app.background.jobs import JobContext, Jobs
from app.background.latest import LatestWorker
from app.document.project_document import ProjectDocument
from app.document.project_settings import ProjectSettings
from app.project.opening.opened_project import OpenedProject
from app.session.captures.capture_commands import FollowRecording
from app.session.editing.kept_document import KeptDocument
from app.session.notices import Notices
from app.session.part import SessionPart
from app.session.training.live_training import LiveTraining
from app.status import RecordingStatus
from app.training.recording.followed_recording import check_unfinished
from app.training.recording.intake import LOOK_EVERY_S, Intake, TakenIn, base_of, check_can_follow, n_taken_of
from engine.capture.capture import Capture, open_capture
from engine.errors import EngineError, ProjectError


@dataclass(frozen=True, slots=True)
class _Look:
    """One look at the folder; on a thread, because it may lie on a slow disk."""

    number: int
    intake: Intake = field(compare=False)


class RecordingFollower(SessionPart):
    """For one thread, and nothing here waits.

    Args:
        document, jobs, notices, live: Of the session.
        take_capture: Puts another reading of the same capture into the open project.
    """

    def __init__(
        self,
        document: KeptDocument,
        jobs: Jobs,
        notices: Notices,
        live: LiveTraining,
        *,
        take_capture: Callable[[Capture, ProjectSettings, str], None],
    ) -> None:
        self._document, self._jobs, self._notices, self._live = document, jobs, notices, live
        self._take_capture = take_capture
        self._opened: OpenedProject | None = None
        self._intake: Intake | None = None
        self._worker: LatestWorker[_Look, TakenIn | None] = LatestWorker("recording", lambda look: look.intake.take())
        self._number, self._next_s = 0, 0.0

    def open(self, opened: OpenedProject) -> None:
        """Another project is open."""
        self._stop()
        self._opened = opened

    def reopen(self, opened: OpenedProject) -> None:
        """The same project is open, with other settings or a longer capture."""
        self._opened = opened

    def check_change(self, before: ProjectDocument, after: ProjectDocument) -> None:
        """A capture that was read as one that grows stays one. Raises ProjectError."""
        if before.settings.is_growing and not after.settings.is_growing:
            raise ProjectError(
                "A capture that was followed while it was recorded cannot count as complete in the same project.",
                hint="Make a new project of it.",
            )

    def status(self) -> RecordingStatus:
        """Whether a recording is followed, and what it waits for."""
        intake = self._intake
        return RecordingStatus() if intake is None else RecordingStatus(is_followed=True, words=intake.words)

    # ---------------------------------------------------------------- commands

    def obey(self, command: FollowRecording) -> None:
        """Begin to follow, or stop. Clips that train or wait go on.

        Raises:
            ProjectError: No project is open for writing, or its settings look at frames that do not exist yet.
        """
        if not command.is_wanted:
            self._stop()
            return
        opened = self._opened
        if opened is None:
            raise ProjectError("No capture is open.", hint="Open one first.")
        opened.project.check_writable()
        if self._intake is not None:
            return
        if opened.project.settings.is_growing:
            self._begin(opened)
        else:
            self._switch(opened)

    def _switch(self, opened: OpenedProject) -> None:
        """Read the capture as one that grows, and follow it."""
        settings, path = opened.project.settings, opened.capture.path
        overrides = {**settings.overrides, "backgrounds": "clip"}
        check_can_follow(replace(settings, overrides=overrides))

        def work(context: JobContext) -> Capture:
            return open_capture(path, scale=settings.scale, follow_links=settings.follow_links, is_growing=True)

        def done(capture: Capture) -> None:
            if self._opened is None or self._opened.generation != opened.generation:
                capture.close()
                return
            first = 0 if settings.frames is None else settings.frames[0]
            n_whole = max(opened.capture.n_frames // settings.clip_length, 1) * settings.clip_length
            n_frames = min(n_whole, opened.capture.n_frames)
            changed = replace(
                self._opened.project.settings,
                overrides=overrides,
                frames=(first, first + n_frames),
                fingerprint=capture.fingerprint,
                is_growing=True,
            )
            try:
                self._take_capture(capture.resized(settings.scale, changed.frames), changed, "follow the recording")
            except EngineError as error:
                self._notices.add_error("The recording cannot be followed", error)
                return
            self._begin(self._opened)

        self._jobs.start("Opening the recording", work, done, self._failed)

    def _begin(self, opened: OpenedProject) -> None:
        project, names = opened.project, opened.capture.rig.names
        check_can_follow(project.settings)
        self._intake = Intake(
            opened.capture,
            n_taken_of(project.settings),
            project.settings.clip_length,
            base=base_of(project.settings),
            is_wanted=lambda camera, frame: not project.document.exclusions.leaves_out(names[camera], frame),
        )
        self._train(range(len(opened.clips)))

    def _stop(self) -> None:
        self._intake = None
        self._worker.forget()

    def _failed(self, error: Exception) -> None:
        if isinstance(error, EngineError):
            self._notices.add_error("The recording cannot be followed", error)
        else:
            self._notices.add_failure("The recording cannot be followed", error)

    # ---------------------------------------------------------------- frames that come

    def poll(self) -> bool:
        """Take in clips that have become complete. Whether there were any."""
        intake, now_s = self._intake, time.monotonic()
        if intake is None or now_s < self._next_s or self._worker.is_busy:  # each look is heard before the next one
            return False
        newest, has_ended = self._worker.newest, intake.has_ended
        is_heard = newest is not None and newest[0].number == self._number  # else it has failed, or is the first
        self._look(intake, now_s)
        if newest is None or not is_heard:
            return False
        taken = newest[1]
        if taken is not None:
            self._take(taken, intake)
        if taken is None and has_ended:
            self._stop()
            self._notices.add("info", "The recording has ended", f"{intake.n_taken} frames are taken in.")
        return taken is not None or has_ended

    def _look(self, intake: Intake, now_s: float) -> None:
        self._number += 1
        self._next_s = now_s + LOOK_EVERY_S
        self._worker.request(_Look(self._number, intake))

    def _take(self, taken: TakenIn, intake: Intake) -> None:
        opened = self._opened
        assert opened is not None
        n_before = len(opened.clips)
        try:
            check_unfinished(opened.project, taken.stop)
            if taken.lost:
                document = taken.without_lost(opened.project.document, opened.capture)
                self._document.change(document, "exclude frames that did not come")
                for sentence in taken.words(intake.limits.patience_s):
                    self._notices.add("warn", "Frames are missing", sentence)
            self._document.grown(taken.grown(opened.project.settings))
            self._train(range(n_before, len(self._opened.clips if self._opened else ())))
        except EngineError as error:
            self._stop()
            self._failed(error)

    def _train(self, clip_indices: Iterable[int]) -> None:
        if self._live.service is not None:
            self._live.service.enqueue_all(list(clip_indices))

    def take_failures(self) -> Iterable[tuple[str, Exception]]:
        """The folder is gone, or holds another capture."""
        found = self._worker.take_error()
        if found is None or self._intake is None:
            return ()
        self._stop()
        return (("The recording is no longer followed", found[1]),)

    @property
    def finished(self) -> object:
        """Differs with every look that says something else."""
        return self.status()

    def close(self) -> None:
        """End the thread."""
        self._worker.close()
