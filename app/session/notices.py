"""Notices: messages to the user, until they are dismissed. Draws nothing."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass

from engine.errors import EngineError

logger = logging.getLogger(__name__)

MAX_NOTICES = 50
"""Older ones make room; the log keeps everything."""


@dataclass(frozen=True, slots=True, eq=False)
class Notice:
    """One message. Compared by identity: the same text may come twice.

    Attributes:
        kind: "info", "warn" or "error".
        title: One short sentence.
        detail: Cause with numbers; may be empty.
        hint: The remedy; may be empty.
    """

    kind: str
    title: str
    detail: str = ""
    hint: str = ""


class Notices:
    """A bounded list of notices, oldest first."""

    def __init__(self) -> None:
        self._notices: list[Notice] = []
        self.revision = 0

    def __len__(self) -> int:
        return len(self._notices)

    def __iter__(self) -> Iterator[Notice]:
        return iter(tuple(self._notices))

    def __getitem__(self, index: int) -> Notice:
        return self._notices[index]

    def add(self, kind: str, title: str, detail: str = "", hint: str = "") -> Notice:
        """Append a notice; the oldest goes when there are too many.

        Raises:
            ValueError: The kind is unknown.
        """
        if kind not in ("info", "warn", "error"):
            raise ValueError(f"a notice is info, warn or error, not {kind!r}")
        notice = Notice(kind, title, detail, hint)
        self._notices = [*self._notices, notice][-MAX_NOTICES:]
        self.revision += 1
        return notice

    def add_error(self, title: str, error: EngineError) -> Notice:
        """A failure the user can act on; every problem of a capture is listed."""
        return self.add("error", title, *error.parts())

    def add_failure(self, title: str, error: Exception) -> Notice:
        """A failure of any kind; one that the user cannot act on is a bug in the program, and is logged."""
        if isinstance(error, EngineError):
            return self.add_error(title, error)
        logger.error("%s", title, exc_info=error)
        detail = f"{type(error).__name__}: {error}"
        return self.add("error", title, detail, "This is a bug in the program; see the log for details.")

    def has_told(self, error: Exception) -> bool:
        """Whether a notice names this cause already."""
        return isinstance(error, EngineError) and any(error.message in notice.detail for notice in self._notices)

    def withdraw(self, notice: Notice) -> None:
        """Remove a notice that does not hold any more; one that is gone already is ignored."""
        for index, found in enumerate(self._notices):
            if found is notice:
                self.dismiss(index)
                return

    def dismiss(self, index: int) -> None:
        """Remove one notice; an index that is gone already is ignored."""
        if 0 <= index < len(self._notices):
            del self._notices[index]
            self.revision += 1
