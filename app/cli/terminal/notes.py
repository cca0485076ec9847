"""What reading a project finds missing in it goes to the terminal, whichever command reads it."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from engine.text import printable

DOCUMENTS = "app.document"
"""Warnings of this package are about what the user made, so that the log alone is not enough."""


class _Notes(logging.Handler):
    """Prints every warning once, however often the project is read."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._said: set[str] = set()

    def emit(self, record: logging.LogRecord) -> None:
        """Print a record on standard error."""
        note = record.getMessage()
        if note not in self._said:
            self._said.add(note)
            sys.stderr.write(printable(f"Note: {note}") + "\n")


@contextmanager
def notes_on_terminal() -> Iterator[None]:
    """In this block, say on standard error what is missing in projects that are read."""
    handler, package = _Notes(), logging.getLogger(DOCUMENTS)
    package.addHandler(handler)
    try:
        yield
    finally:
        package.removeHandler(handler)
