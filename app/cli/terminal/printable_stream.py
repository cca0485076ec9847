"""Results of the command line on their way to a terminal or a file: nothing in a name can command the terminal."""

from __future__ import annotations

import io
from typing import TextIO

from engine.text import printable


class PrintableStream(io.TextIOBase):
    """A text stream in front of another, for results: what goes through it is printable.

    Args:
        stream: As sys.stdout. Characters that its encoding lacks are written out too.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")

    def write(self, text: str, /) -> int:
        """Write text; returns its length."""
        self._stream.write(printable(text))
        return len(text)

    def flush(self) -> None:
        """Hand on what waits."""
        self._stream.flush()

    def isatty(self) -> bool:
        """Whether a terminal shows it."""
        return self._stream.isatty()

    def writable(self) -> bool:
        """It is."""
        return True
