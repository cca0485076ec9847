"""KeptDocument: the document of the open project. A change holds at once and reaches the disk a moment later, on a
thread; `settle` waits for that.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass, field

from app.background.latest import LatestWorker
from app.document.history import Changed, DocumentHistory, Event, ObjectFound, Placed, Redone, Undone, coalesced
from app.document.project_document import ProjectDocument
from app.document.project_settings import ProjectSettings
from app.project.opening.opened_project import OpenedProject
from app.project.project import Project
from app.session.edit_status import HistoryStatus
from app.session.part import SessionPart
from engine.errors import DiskError, EngineError, ProjectError

logger = logging.getLogger(__name__)

RETRY_S = 5.0
"""How long after the disk has refused something it is asked again."""
KEPT_WITHIN_S = 0.08
"""So long the next step waits until the last one is on disk, which normally takes some milliseconds."""
SETTLE_S = 2.0
"""A disk that takes longer than this to write a few lines is not waited for while somebody works."""
CLOSING_S = 20.0
"""Nor for longer than this at the end, where what is not written then is lost."""
Guard = Callable[[ProjectDocument, ProjectDocument], None]
"""Sees whether one document may take the place of another; raises ProjectError where not."""


@dataclass(frozen=True, slots=True)
class DocumentRequest:
    """Keep new events, or read the project.

    Attributes:
        number: Of the request; a later one is another request.
    """

    number: int
    is_reading: bool
    project: Project = field(compare=False)
    history: DocumentHistory = field(compare=False)


class KeptDocument(SessionPart):
    """For one thread, which waits for the disk a moment at most: a kill costs the step that is being made, and none
    before it.

    Args:
        guard: Asked before every change, undo and redo.
        on_change: Called with the documents before and after each of them.
    """

    def __init__(self, *, guard: Guard, on_change: Callable[[ProjectDocument, ProjectDocument], None]) -> None:
        self._guard, self._on_change = guard, on_change
        self._files: LatestWorker[DocumentRequest, DocumentHistory] = LatestWorker("document", self._keep_or_read)
        self._project: Project | None = None
        self._number = 0
        self._last: DocumentRequest | None = None
        self._awaited: int | None = None
        self._problem = ""
        self._retry_at_s: float | None = None
        self._lock = threading.Lock()
        self._pending: list[Event] = []
        self._last_event: Event | None = None
        self._told: tuple[DocumentHistory | None, HistoryStatus] = (None, HistoryStatus())

    @property
    def project(self) -> Project | None:
        """Whose document it is."""
        return self._project

    @property
    def content(self) -> ProjectDocument | None:
        """The document; None where no project is open."""
        return None if self._project is None else self._project.document

    def status(self) -> HistoryStatus:
        """Steps that can be undone and redone."""
        if self._project is None:
            return HistoryStatus()
        history = self._project.history
        if history is not self._told[0]:  # asked at every turn of the window's loop
            past, future = (tuple(step.name for step in steps) for steps in (history.past, history.future[::-1]))
            self._told = history, HistoryStatus(history.undo_name, history.redo_name, past, future)
        return self._told[1]

    def open(self, opened: OpenedProject) -> None:
        """Another project is open."""
        self.hold(opened.project)

    def hold(self, project: Project) -> None:
        """Take another project, with its document."""
        self.leave()
        self._project = project

    def leave(self) -> None:
        """Let go of the project once everything is kept."""
        self._settle_for_good()
        self._files.forget()
        with self._lock:  # nobody needs the writing still in progress any more
            self._project = None
            self._pending, self._last = [], None
        self._awaited, self._problem, self._retry_at_s = None, "", None

    # ---------------------------------------------------------------- changes

    def change(self, document: ProjectDocument, name: str, merge: Hashable = None) -> None:
        """Hold something else. name, merge: See app.document.history.Changed.

        Raises:
            ProjectError: Nothing can be changed now, or not to this.
        """
        self._happen(Changed(name, document, merge))

    def found(self, found: ObjectFound) -> None:
        """Take up where an object is, in all documents of the history. Raises ProjectError like `change`."""
        self._happen(found)

    def grown(self, settings: ProjectSettings) -> None:
        """The capture has grown: hold settings with its frames. Not a step. Raises ProjectError like `change`."""
        self._happen(Placed(settings))

    def undo(self) -> None:
        """Take back the last step; nothing happens without one.

        Raises:
            ProjectError: It cannot be taken back now; the step stays.
        """
        if self._project is not None and self._project.history.past:
            self._happen(Undone())

    def redo(self) -> None:
        """Do the last undone step again; nothing happens without one, or when something else was done since.

        Raises:
            ProjectError: It cannot be done now; the step stays.
        """
        if self._project is not None and self._project.history.future:
            self._happen(Redone())

    def _happen(self, event: Event) -> None:
        project = self.checked()
        before, history = project.document, project.history.after(event)
        self._guard(before, history.present)
        if self._last_event is not None and len(coalesced([self._last_event, event])) > 1:  # another step
            self._files.wait_idle(KEPT_WITHIN_S)
        self._last_event = event
        with self._lock:
            project.history = history
            self._pending.append(event)
        self._request(project, is_reading=False)
        self._on_change(before, history.present)

    def checked(self) -> Project:
        """The project, if something can be changed in it.

        Raises:
            ProjectError: Not now; states the cause.
        """
        if self._project is None:
            raise ProjectError("No capture is open.", hint="Open a capture first; its project keeps the edits.")
        self._project.check_writable()
        if self._problem:
            raise ProjectError(self._problem)
        if self._awaited is not None:
            raise ProjectError("The project file is being reloaded.", hint="Try again in a moment.")
        return self._project

    def why_not(self) -> str:
        """Why nothing can be changed now, in one line; empty when it can."""
        try:
            self.checked()
        except ProjectError as error:
            return _sentence(error)
        return ""

    # ---------------------------------------------------------------- files

    def _request(self, project: Project, *, is_reading: bool) -> None:
        self._number += 1
        if is_reading:
            self._awaited = self._number
        self._last = DocumentRequest(self._number, is_reading, project, project.history)
        self._files.request(self._last)

    def _keep_or_read(self, request: DocumentRequest) -> DocumentHistory:
        store = request.project.store
        if request.is_reading:
            return store.read()
        with self._lock:  # those of later requests too: their own find nothing more to do
            if self._project is not request.project:  # the disk was slow; these are events of another project
                return request.history
            events, self._pending = self._pending, []
            history = request.project.history
        try:
            store.write(events, history)
        except DiskError:
            with self._lock:  # to be tried again
                if self._project is request.project:
                    self._pending = [*events, *self._pending]
            raise
        return history

    def take_error(self) -> Exception | None:
        """The last failure, once. A write that the disk refused is tried again after a while, and with the next
        change; after any other failure of a write, the project is read again."""
        found = self._files.take_error()
        if found is None or self._project is None or found[0].project is not self._project:
            return None
        request, error = found
        if not request.is_reading and isinstance(error, DiskError):
            self._retry_at_s = time.monotonic() + RETRY_S
        elif not request.is_reading:
            with self._lock:
                self._pending = []
            self._request(self._project, is_reading=True)
        elif request.number == self._awaited:
            self._awaited, self._problem = None, _sentence(error)
        return error

    def poll(self) -> bool:
        """Take in the document that was read. Whether there was one."""
        if self._project is not None and self._retry_at_s is not None and time.monotonic() >= self._retry_at_s:
            self._retry_at_s = None
            self._request(self._project, is_reading=False)
        newest = self._files.newest
        if self._project is None or newest is None or newest[0].number != self._awaited:
            return False
        before = self._project.document
        self._project.history, self._awaited = newest[1], None
        self._on_change(before, self._project.document)
        return True

    def take_failures(self) -> Iterable[tuple[str, Exception]]:
        """See `take_error`."""
        error = self.take_error()
        return () if error is None else (("Edits could not be read or saved", error),)

    def settle(self) -> bool:
        """Wait until changes are on disk; longer than a moment only where the disk is at fault. Whether they are."""
        is_idle = self._files.wait_idle(SETTLE_S)
        last = self._last
        return is_idle and not self._pending and not (last is not None and self._files.has_failed(last))

    def close(self) -> None:
        """Keep all changes, end the thread."""
        self._files.wait_idle(CLOSING_S)
        self._settle_for_good()
        self._files.close()

    def _settle_for_good(self) -> None:
        self.settle()
        found = self._files.take_error()
        if found is not None:  # nobody will ask any more
            logger.error("the project file could not be read or kept: %s", found[1])


def _sentence(error: Exception) -> str:
    """Cause and hint in one line, without the path: the panel that shows it is narrow."""
    return f"{error.message} {error.hint}".strip() if isinstance(error, EngineError) else str(error)
