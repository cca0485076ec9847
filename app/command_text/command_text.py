"""CommandText: one thing that was done, as a command line and as Python."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from app.command_text.quoting import shell_line

PROGRAM, MODULE = "clipgstream", "clipgstream"


@dataclass(frozen=True, slots=True)
class CommandText:
    """One command.

    Attributes:
        arguments: After the program's name.
        stdin: One line that it reads from standard input, such as JSON, which may be longer than systems let arguments
            be; empty for none.
        statement: The same in Python, of an open `project`.
        names: The statement's imports from the module other than `open_project`.
        folder: Of the project.
        reads_only: Whether the project need not be open for writing.
    """

    arguments: tuple[str, ...]
    statement: str
    folder: Path
    names: tuple[str, ...] = ()
    stdin: str = ""
    reads_only: bool = False

    def shell(self, *, is_windows: bool = sys.platform == "win32") -> str:
        """A command to paste into a terminal."""
        return shell_line((PROGRAM, *self.arguments), self.stdin, is_windows=is_windows)

    @property
    def python(self) -> str:
        """Lines that do the same in a script. Training starts processes, which need the guard."""
        names = ", ".join(sorted({*self.names, "open_project"}, key=lambda name: (name.islower(), name)))
        options = ", read_only=True" if self.reads_only else ""
        return (
            f"from {MODULE} import {names}\n\n"
            'if __name__ == "__main__":\n'
            f"    with open_project({str(self.folder)!r}{options}) as project:\n"
            f"        {self.statement}\n"
        )
