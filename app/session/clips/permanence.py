"""Permanence: applies deletions to the clips of the open project for good. Asks first; jobs do the work."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from app.applying.applying import NAME, StagedClips, edits_after, exchange_staged, stage
from app.applying.deletions import Deletions, find_deletions
from app.background.jobs import JobContext, Jobs
from app.project.clips.clip_exchange import give_up_exchange
from app.project.opening.opened_project import OpenedProject
from app.session.clips.clip_commands import ApplyDeletions
from app.session.clips.clip_questions import DeletionsQuestion
from app.session.editing.kept_document import KeptDocument
from app.session.notices import Notices
from app.training.service import TrainingService
from engine.errors import EngineError, ProjectError

TITLE = "Deletions cannot be applied permanently"


class Permanence:
    """For one thread, and nothing here waits for more than a few lines to reach the disk.

    Args:
        jobs, notices, document: Of the session.
        ask: Takes the question whether it is to be done.
    """

    def __init__(
        self, jobs: Jobs, notices: Notices, document: KeptDocument, ask: Callable[[DeletionsQuestion], None]
    ) -> None:
        self._jobs, self._notices, self._document, self._ask = jobs, notices, document, ask
        self._is_busy = False
        self._n_done = 0

    def obey(self, command: ApplyDeletions, opened: OpenedProject, service: TrainingService) -> None:
        """Look up what can be applied and ask, or do it.

        Raises:
            ProjectError: Something trains, or the project cannot be changed.
        """
        self._document.checked()
        _check_idle(service)
        if self._is_busy:  # a second click
            return
        self._is_busy = True
        project, clips, document = opened.project, opened.clips, opened.project.document

        def find(context: JobContext) -> Deletions:
            def report(n_done: int, n_all: int) -> None:
                context.report(n_done / max(n_all, 1))

            return find_deletions(project, clips, report, document=document)

        if not command.is_confirmed:
            self._jobs.start("Looking for deleted anchors", find, self._found, self._failed)
            return

        def work(context: JobContext) -> StagedClips:
            found = find(context)
            return stage(project, found, lambda n_done, n_all: context.report(n_done / max(n_all, 1)))

        def staged(result: StagedClips) -> None:
            self._exchange(result, opened, service)

        self._jobs.start("Rewriting clips", work, staged, self._failed)

    def check_idle(self) -> None:
        """Check that nothing is applied at the moment.

        Raises:
            ProjectError: Something is.
        """
        if self._is_busy:
            raise ProjectError("Deletions are being applied to the clips.", hint="Wait until they are applied.")

    def _found(self, deletions: Deletions) -> None:
        self._is_busy = False
        n_clips = sum(1 for clip in deletions.clips.values() if clip.n_anchors)
        if deletions.n_anchors:
            self._ask(DeletionsQuestion(deletions.n_anchors, n_clips, len(deletions.untrained)))
        else:
            self._notices.add(
                "info",
                "Nothing can be applied permanently",
                "No anchor is fully deleted in all frames of its clip. The edits stay in the stack.",
            )

    def _exchange(self, staged: StagedClips, opened: OpenedProject, service: TrainingService) -> None:
        project, content = opened.project, self._document.content
        try:
            _check_idle(service)
            if self._document.project is not project or content is None:
                raise ProjectError("Another project is open.", hint="Open this one again.")
            if (content.edits, content.objects) != (staged.before, staged.objects_before):
                raise ProjectError("The edits have changed in the meantime.", hint="Apply them again.")
            self._n_done += 1
            step = (NAME, self._n_done)
            if (staged.during, staged.objects) != (staged.before, staged.objects_before):
                during = replace(content, edits=staged.during, objects=staged.objects)
                self._document.change(during, NAME, merge=step)
                if not self._document.settle():  # it has to be on disk before the clips are others
                    raise ProjectError("Recent edits are not saved yet.", hint="Apply them again in a moment.")
        except EngineError as error:
            give_up_exchange(project.folder)
            self._failed(error)
            return

        def work(context: JobContext) -> None:
            exchange_staged(project, staged)

        def done(_: None) -> None:
            self._is_busy = False
            now = self._document.content
            if now is not None and self._document.project is project:
                after = edits_after(now, staged)
                if after.edits != now.edits:
                    self._document.change(after, NAME, merge=step)
            for clip_index in staged.clip_indices:
                service.catalog.update(clip_index)
            self._notices.add("info", "Deletions were applied permanently", staged.text())

        self._jobs.start("Exchanging clips", work, done, self._failed)

    def _failed(self, error: Exception) -> None:
        self._is_busy = False
        if isinstance(error, EngineError):
            self._notices.add_error(TITLE, error)
        else:
            self._notices.add_failure(TITLE, error)


def _check_idle(service: TrainingService) -> None:
    if service.in_training:
        raise ProjectError(
            f"Clip {min(service.in_training)} is training and would not match the rewritten clips.",
            hint="Let training end, or stop it; progress is kept.",
        )
