"""History: what the user did to the content of a project, and the way back, over everything that can be edited.

Each kind of content is a document that hands out what it holds as one immutable value, and takes such a value back.
Undo takes back whatever was done last, in whichever document that was.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, replace
from typing import Any, Protocol

from app.session.edit_status import HistoryStatus

MAX_STEPS = 100


class Document(Protocol):
    """Something that is edited."""

    @property
    def content(self) -> Any:
        """What it holds, as a value that never changes."""
        ...

    def put_back(self, content: Any) -> None:
        """Hold this again, without a new step of the history. Raises ProjectError where nothing can be changed."""
        ...


@dataclass(frozen=True, slots=True)
class _Step:
    """One thing to take back, or to do again.

    Attributes:
        name: What was done, as a word or two that can follow "Undo".
        content: What the document then holds.
        merge: Steps in a row with the same one count as one.
    """

    document: Document
    name: str
    content: Any
    merge: Hashable = None


class History:
    """Steps back and forth. Belongs to one thread."""

    def __init__(self) -> None:
        self._past: list[_Step] = []
        self._future: list[_Step] = []

    def note(self, document: Document, name: str, before: Any, merge: Hashable = None) -> None:
        """Something was changed; what was undone before can no longer be done again.

        Args:
            before: What the document held until now.
            merge: The same as that of the last step for what belongs to it, such as the next stretch of a drag.
        """
        self._future = []
        last = self._past[-1] if self._past else None
        if last is not None and merge is not None and last.document is document and last.merge == merge:
            return
        self._past = [*self._past, _Step(document, name, before, merge)][-MAX_STEPS:]

    def undo(self) -> None:
        """Take back the last change; nothing happens without one.

        Raises:
            ProjectError: Nothing can be changed now; the step stays.
        """
        self._move(self._past, self._future)

    def redo(self) -> None:
        """Do again what was taken back last; nothing happens when nothing was, or something else was done since.

        Raises:
            ProjectError: Nothing can be changed now; the step stays.
        """
        self._move(self._future, self._past)

    def _move(self, source: list[_Step], target: list[_Step]) -> None:
        if not source:
            return
        step = source[-1]
        now = step.document.content
        step.document.put_back(step.content)
        source.pop()
        target.append(replace(step, content=now, merge=None))
        if self._past:  # what is done from here on is a step of its own
            self._past[-1] = replace(self._past[-1], merge=None)

    def forget(self, document: Document) -> None:
        """Drop the steps of a document whose content came from somewhere else."""
        self._past = [step for step in self._past if step.document is not document]
        self._future = [step for step in self._future if step.document is not document]

    def status(self) -> HistoryStatus:
        """Both ways as one value."""
        return HistoryStatus(
            undo=self._past[-1].name if self._past else "", redo=self._future[-1].name if self._future else ""
        )
