"""KeptDocument: one kind of content of the open project that the user edits. A change holds at once and reaches the
disk a moment later, on a thread; `settle` waits for that.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from app.background.latest import LatestWorker
from app.project.project import Project
from app.session.history import History
from engine.errors import EngineError, ProjectError

logger = logging.getLogger(__name__)

SETTLE_S = 2.0
"""A disk that takes longer than this to write a few lines is not waited for."""
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class DocumentRequest:
    """Keep this content in the project, or read its own.

    Attributes:
        number: Of the request; a later one is another request even with the same content.
        content: Not looked at when reading.
    """

    number: int
    is_reading: bool
    content: Any = field(compare=False)
    project: Project = field(compare=False)


class KeptDocument(Generic[T]):
    """For one thread, which never waits for the disk. See app.session.history.Document.

    Attributes:
        content: What is held.
        what: Names it, in the plural: "marked regions".

    Args:
        what: See above.
        empty: Content where there is none. An immutable value, as all content is.
        read, write: Content of a project's file; raise ProjectError.
        history: Where changes are noted.
    """

    def __init__(
        self,
        what: str,
        *,
        empty: T,
        read: Callable[[Project], T],
        write: Callable[[Project, T], None],
        history: History,
    ) -> None:
        self.content = empty
        self.what, self._empty, self._read_file, self._write_file = what, empty, read, write
        self._history = history
        self._files: LatestWorker[DocumentRequest, T] = LatestWorker(what, self._keep_or_read)
        self._project: Project | None = None
        self._number = 0
        self._awaited: int | None = None
        self._problem = ""

    @property
    def project(self) -> Project | None:
        """Whose content it is."""
        return self._project

    def open(self, project: Project) -> None:
        """Take another project; its content is there a moment later."""
        self.leave()
        self._project = project
        self._read()

    def leave(self) -> None:
        """Let go of the project once everything is kept."""
        self._settle_for_good()
        self._files.forget()
        self._history.forget(self)
        self._project, self.content = None, self._empty
        self._awaited, self._problem = None, ""

    # ---------------------------------------------------------------- changes

    def change(self, content: T, name: str, merge: Hashable = None) -> None:
        """Hold something else. name, merge: See History.note.

        Raises:
            ProjectError: Nothing can be changed now.
        """
        before = self.content
        self.put_back(content)
        self._history.note(self, name, before, merge)

    def put_back(self, content: T) -> None:
        """Hold something else without noting it.

        Raises:
            ProjectError: Nothing can be changed now.
        """
        project = self.checked()
        self.content = content
        self._number += 1
        self._files.request(DocumentRequest(self._number, False, content, project))

    def checked(self) -> Project:
        """The project, if something can be changed in it.

        Raises:
            ProjectError: Not now; says why.
        """
        if self._project is None:
            raise ProjectError("No capture is open.", hint=f"Open a capture first; its project keeps the {self.what}.")
        self._project.check_writable()
        if self._problem:
            raise ProjectError(self._problem)
        if self._awaited is not None:
            raise ProjectError(f"The {self.what} are still being read.", hint="Try again in a moment.")
        return self._project

    def why_not(self) -> str:
        """Why nothing can be changed now, in one line; empty when it can."""
        try:
            self.checked()
        except ProjectError as error:
            return _sentence(error)
        return ""

    # ---------------------------------------------------------------- files

    def _read(self) -> None:
        assert self._project is not None
        self._number += 1
        self._awaited = self._number
        self._history.forget(self)
        self._files.request(DocumentRequest(self._number, True, None, self._project))

    def _keep_or_read(self, request: DocumentRequest) -> T:
        if request.is_reading:
            return self._read_file(request.project)
        self._write_file(request.project, request.content)
        return request.content

    def take_error(self) -> Exception | None:
        """The last failure, once. After one of writing, what the project holds is read again."""
        found = self._files.take_error()
        if found is None or self._project is None or found[0].project is not self._project:
            return None
        request, error = found
        if not request.is_reading:
            self._read()
        elif request.number == self._awaited:
            self._awaited, self._problem = None, _sentence(error)
        return error

    def poll(self) -> bool:
        """Take in what was read. Whether there was something."""
        newest = self._files.newest
        if newest is None or newest[0].number != self._awaited:
            return False
        self.content, self._awaited = newest[1], None
        return True

    def settle(self) -> None:
        """Wait until what was changed is on disk; longer than a moment only where the disk is at fault."""
        self._files.wait_idle(SETTLE_S)

    def close(self) -> None:
        """Keep what was changed, end the thread."""
        self._settle_for_good()
        self._files.close()

    def _settle_for_good(self) -> None:
        self.settle()
        found = self._files.take_error()
        if found is not None:  # nobody will ask any more
            logger.error("the %s could not be read or kept: %s", self.what, found[1])


def _sentence(error: Exception) -> str:
    """Cause and hint in one line, without the path: the panel that shows it is narrow."""
    return f"{error.message} {error.hint}".strip() if isinstance(error, EngineError) else str(error)
