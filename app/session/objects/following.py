"""Following: lets volumes of edits go along with objects. A job looks where the object is; then the edit changes, in
one step.
"""

from __future__ import annotations

from collections.abc import Callable

from msgspec import structs

from app.background.jobs import BackgroundJob, JobContext, Jobs
from app.document.changes.edit_changes import edit_with
from app.document.changes.object_changes import object_with
from app.objects.following import Report, follow_in_project
from app.project.opening.opened_project import OpenedProject
from app.session.editing.edit_commands import ChangeEdit
from app.session.editing.edits import changed
from app.session.editing.kept_document import KeptDocument
from app.session.notices import Notices
from app.session.objects.follow_commands import FollowObject
from app.session.part import SessionPart
from engine.editing.edit import KeyedVolume, Target
from engine.editing.scene_object import SceneObject
from engine.errors import EngineError, ProjectError

TITLE = "The volume cannot follow the object"
Follow = Callable[[OpenedProject, SceneObject, Target, Report], KeyedVolume]


class Following(SessionPart):
    """For one thread, and nothing here waits.

    Args:
        document, jobs, notices: Of the session.
        follow: Makes the keys.
    """

    def __init__(self, document: KeptDocument, jobs: Jobs, notices: Notices, *, follow: Follow | None = None) -> None:
        self._document, self._jobs, self._notices = document, jobs, notices
        self.follow: Follow = _follow if follow is None else follow
        self._opened: OpenedProject | None = None
        self._job: BackgroundJob | None = None

    def open(self, opened: OpenedProject) -> None:
        """Another project is open."""
        self.close()
        self._opened = opened

    def reopen(self, opened: OpenedProject) -> None:
        """The same project is open, with other settings."""
        self.open(opened)

    def grow(self, opened: OpenedProject) -> None:
        """Its capture has grown: running work goes on."""
        self._opened = opened

    def apply(self, command: FollowObject) -> None:
        """Begin to look; one that is under way ends.

        Raises:
            ProjectError: There is no such object or edit, or nothing can be changed now.
        """
        document, opened = self._document.checked().document, self._opened
        if opened is None:
            raise ProjectError("No project is open.", hint="Open one first.")
        one, edit = object_with(document, command.object_id), edit_with(document, command.edit_id)
        self.close()

        def work(context: JobContext) -> KeyedVolume:
            return self.follow(opened, one, edit.target, lambda n_done, n_all: context.report(n_done / max(n_all, 1)))

        def done(keyed: KeyedVolume) -> None:
            self._job = None
            now = self._document.content
            if now is None or self._document.project is not opened.project:
                return
            present = next((other for other in now.edits if other.edit_id == edit.edit_id), None)
            if present is None:  # removed meanwhile
                return
            try:
                change = changed(now, ChangeEdit(structs.replace(present, target=keyed), verb=f"follow {one.name}"))
                self._document.change(change.document, change.name)
            except EngineError as error:
                self._failed(error)

        self._job = self._jobs.start(f"Following {one.name}", work, done, self._failed, can_cancel=True)

    def close(self) -> None:
        """End the work; its result is not wanted."""
        if self._job is not None:
            self._job.context.cancel()
        self._job = None

    def _failed(self, error: Exception) -> None:
        self._job = None
        self._notices.add_failure(TITLE, error)


def _follow(opened: OpenedProject, one: SceneObject, target: Target, report: Report) -> KeyedVolume:
    return follow_in_project(opened.project, opened.capture, one, target, report)
