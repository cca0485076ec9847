"""SessionPart: one of the things that a session is composed of. SessionParts: all of them, in the order in which they
were added.

A part is added once: opening, settings, polling and closing reach it from then on.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

from app.document.project_document import ProjectDocument
from app.project.opening.opened_project import OpenedProject


class SessionPart:
    """Overrides the methods that concern it. For one thread, and nothing here waits."""

    def open(self, opened: OpenedProject) -> None:
        """Another project is open."""

    def reopen(self, opened: OpenedProject) -> None:
        """The same project is open, with other settings."""

    def grow(self, opened: OpenedProject) -> None:
        """The capture of the same project has more frames and clips now; the others are as they were."""
        self.reopen(opened)

    def check_idle(self) -> None:
        """Check that it writes no clips, so that they may be cut otherwise or copied. Raises ProjectError."""

    def check_change(self, before: ProjectDocument, after: ProjectDocument) -> None:
        """See whether one document may take the place of another. Raises ProjectError."""

    def follow_change(self, before: ProjectDocument, after: ProjectDocument) -> None:
        """The document has changed: show the consequences."""

    def close_page(self) -> None:
        """Close the page."""

    def poll(self) -> bool:
        """Take in finished work. Whether anything visible changed."""
        return False

    @property
    def finished(self) -> object:
        """Differs whenever a thread has finished something, or there is something else to show."""
        return None

    def take_failures(self) -> Iterable[tuple[str, Exception]]:
        """Failures since the last call: a title for the user, and the error."""
        return ()

    def close(self) -> None:
        """End threads and processes, keeping progress."""


PartT = TypeVar("PartT", bound=SessionPart)


class SessionParts(SessionPart):
    """All of them."""

    def __init__(self) -> None:
        self._parts: list[SessionPart] = []

    def add(self, part: PartT) -> PartT:
        """Add a part; its turn comes after those added before."""
        self._parts.append(part)
        return part

    def open(self, opened: OpenedProject) -> None:
        for part in self._parts:
            part.open(opened)

    def reopen(self, opened: OpenedProject) -> None:
        for part in self._parts:
            part.reopen(opened)

    def grow(self, opened: OpenedProject) -> None:
        for part in self._parts:
            part.grow(opened)

    def check_idle(self) -> None:
        for part in self._parts:
            part.check_idle()

    def check_change(self, before: ProjectDocument, after: ProjectDocument) -> None:
        for part in self._parts:
            part.check_change(before, after)

    def follow_change(self, before: ProjectDocument, after: ProjectDocument) -> None:
        for part in self._parts:
            part.follow_change(before, after)

    def close_page(self) -> None:
        for part in self._parts:
            part.close_page()

    def poll(self) -> bool:
        return any([part.poll() for part in self._parts])  # each of them, regardless of the others

    @property
    def finished(self) -> object:
        return tuple(part.finished for part in self._parts)

    def take_failures(self) -> Iterable[tuple[str, Exception]]:
        return [failure for part in self._parts for failure in part.take_failures()]

    def close(self) -> None:
        for part in self._parts:
            part.close()
