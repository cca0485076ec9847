"""StartingOver: everything that is trained in the open project is discarded, to train it with other settings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from app.background.jobs import JobContext, Jobs
from app.project.disk.discarding import discard, training_of
from app.project.opening.opened_project import OpenedProject
from app.session.editing.kept_document import KeptDocument
from app.session.notices import Notices
from app.session.questions import Question, StartOverQuestion
from engine.training.presets import PRESETS, closest_preset, preset

NAME = "Starting over"


class StartingOver:
    """For one thread, which does not wait: files are looked at and deleted on another.

    Args:
        jobs, notices, document: Of the session.
        ask: Takes the question; None once it is answered.
        reopen: Called when it is done, to read the files on disk anew.
    """

    def __init__(
        self,
        jobs: Jobs,
        notices: Notices,
        document: KeptDocument,
        *,
        ask: Callable[[Question | None], None],
        reopen: Callable[[], None],
    ) -> None:
        self._jobs, self._notices, self._document, self._ask, self._reopen = jobs, notices, document, ask, reopen

    def ask(self, opened: OpenedProject) -> None:
        """Find out what would be discarded, and ask.

        Raises:
            ProjectError: The project is read-only.
        """
        project = opened.project
        project.check_writable()
        now = closest_preset(project.settings.overrides)

        def work(context: JobContext) -> StartOverQuestion:
            return StartOverQuestion(project.folder, training_of(project).words, tuple(PRESETS), now)

        self._jobs.start("Reading the project", work, self._ask, self._failed)

    def start(self, opened: OpenedProject, name: str, question: Question | None) -> None:
        """Discard all progress, and take a preset.

        Args:
            question: The one that is answered by this; it stays up meanwhile.
        Raises:
            ProjectError: The project is read-only, or there is no such preset.
        """
        project, overrides = opened.project, preset(name)
        project.check_writable()
        if isinstance(question, StartOverQuestion):
            self._ask(replace(question, is_working=True))

        def work(context: JobContext) -> str:
            found = training_of(project)
            discard(project, found)
            return found.words

        def done(words: str) -> None:
            self._ask(None)
            if self._document.project is not project:  # another one was opened meanwhile
                return
            settings = replace(project.settings, overrides=overrides)
            settings = replace(settings, overrides=settings.config().difference())
            if settings != project.settings:
                self._document.change(replace(project.document, settings=settings), f"start over with {name}")
            self._reopen()
            if words:
                self._notices.add("info", f"Started over with the preset {name}", f"Discarded: {words}.")

        def failed(error: Exception) -> None:
            self._ask(None)
            self._reopen()
            self._failed(error)

        self._jobs.start(NAME, work, done, failed)

    def _failed(self, error: Exception) -> None:
        self._notices.add_failure("Training cannot start over", error)
