"""Filling: fills behind edits of the open project, one after another, on a thread."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from msgspec import structs

from app.background.jobs import BackgroundJob, JobContext, Jobs
from app.document.changes.edit_changes import edit_with
from app.project.opening.opened_project import OpenedProject
from app.session.editing.edit_commands import ChangeEdit, FillBehind
from app.session.editing.edits import changed
from app.session.editing.kept_document import KeptDocument
from app.session.notices import Notices
from app.session.part import SessionPart
from engine.editing.actions import Delete, Hide
from engine.editing.edit import Edit
from engine.editing.effects import EditStack
from engine.editing.fills.fill import fill_key
from engine.errors import EngineError, ProjectError

Fills = Callable[[OpenedProject, EditStack, int, Callable[[int, int], None]], Edit]
"""Fills behind an edit of a stack; see app.filling.fill_edit."""
FAILED = "Nothing could be filled"


class Filling(SessionPart):
    """For one thread, and nothing here waits.

    Args:
        document: Holds and keeps the edits.
        jobs, notices: Of the session.
        fill: Does the work.
    """

    def __init__(self, document: KeptDocument, jobs: Jobs, notices: Notices, fill: Fills | None = None) -> None:
        self._document, self._jobs, self._notices = document, jobs, notices
        self._fill: Fills = _filled if fill is None else fill
        self._opened: OpenedProject | None = None
        self._job: BackgroundJob | None = None

    def open(self, opened: OpenedProject) -> None:
        """Another project is open."""
        self._stop()
        self._opened = opened

    def reopen(self, opened: OpenedProject) -> None:
        """The same project is open, with other settings."""
        self.open(opened)

    def grow(self, opened: OpenedProject) -> None:
        """Its capture has grown: running work goes on."""
        self._opened = opened

    def close(self) -> None:
        """End the work."""
        self._stop()

    def apply(self, command: FillBehind) -> None:
        """Begin to fill behind an edit; its fill becomes a step of the history.

        Raises:
            ProjectError: There is no such edit, it takes nothing away, or one is being filled.
        """
        document, opened = self._document.checked().document, self._opened
        edit = edit_with(document, command.edit_id)
        if not isinstance(edit.action, Delete | Hide):
            raise ProjectError(f"Edit {edit.edit_id} takes nothing away.", hint="Choose one that deletes or hides.")
        if self._job is not None and self._job.is_running:
            raise ProjectError("An edit is being filled.", hint="Wait until it is done, or cancel it.")
        assert opened is not None  # there is a document
        stack = document.stack()

        def work(context: JobContext) -> Edit:
            return self._fill(opened, stack, edit.edit_id, lambda n, total: context.report(n / max(total, 1)))

        def done(found: Edit) -> None:
            self._job = None
            if self._opened is opened:
                self._take(found)

        self._job = self._jobs.start("Filling behind an edit", work, done, self._failed, can_cancel=True)

    def _take(self, found: Edit) -> None:
        """Give its fill to the edit as it is now."""
        content = self._document.content
        now = next((edit for edit in content.edits if edit.edit_id == found.edit_id), None) if content else None
        if content is None or now is None or fill_key(now) != fill_key(found):
            self._notices.add_error(
                FAILED, ProjectError("The edit has changed in the meantime.", hint="Fill it again.")
            )
            return
        change = changed(content, ChangeEdit(structs.replace(now, fill=found.fill), verb="fill behind"))
        try:
            self._document.change(change.document, change.name, change.merge)
        except EngineError as error:
            self._notices.add_error(FAILED, error)

    def _failed(self, error: Exception) -> None:
        self._job = None
        self._notices.add_failure(FAILED, error)

    def _stop(self) -> None:
        if self._job is not None:
            self._job.context.cancel()
        self._job = None


def _filled(opened: OpenedProject, stack: EditStack, edit_id: int, report: Any) -> Edit:
    from app.evaluation.headless import open_trained
    from app.filling.fill_edit import fill_behind

    return fill_behind(open_trained(opened.project, opened.capture), stack, edit_id, report)[0]
