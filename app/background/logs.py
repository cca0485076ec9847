"""Logging set-up: one file for the program, shared by all its processes, and one plain file per worker.

Nothing that happens to a log may reach the user: a record that cannot be written is silently lost.
"""

from __future__ import annotations

import logging
import os
from contextlib import suppress
from pathlib import Path

from engine.storage.files import open_regular
from engine.text import printable
from engine.user_folders import data_dir

FORMAT = "%(asctime)s %(levelname)s %(name)s: %(message)s"
MAX_LOG_BYTES = 2_000_000
N_OLD = 2
"""Earlier files that are kept next to the log, each of about MAX_LOG_BYTES."""


class PrintableFormatter(logging.Formatter):
    """Escapes characters that a terminal would obey or that no encoding holds, as in names of files and cameras."""

    def format(self, record: logging.LogRecord) -> str:
        """The record as text."""
        return printable(super().format(record))


class SharedLogHandler(logging.Handler):
    """Appends each record to a file that other processes append to as well; moves it aside when it is large.

    The file is opened for every record, so that moving it aside disturbs no other process, and written to in one piece,
    which the system keeps whole.

    Args:
        path: The log. Its folder must exist.
        max_bytes: Size beyond which it becomes `path` with ".1".
    """

    def __init__(self, path: Path, *, max_bytes: int = MAX_LOG_BYTES) -> None:
        super().__init__()
        self.path, self._max_bytes = path, max_bytes

    def emit(self, record: logging.LogRecord) -> None:
        """Write a record; one that cannot be formatted or written is lost."""
        with suppress(Exception):  # the edge: logging must never fail its caller
            self.write((self.format(record) + "\n").encode("utf-8", "backslashreplace"))

    def write(self, data: bytes) -> None:
        """Append bytes. Raises OSError when the disk refuses."""
        handle = os.open(self.path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | getattr(os, "O_BINARY", 0), 0o644)
        try:
            size = os.fstat(handle).st_size
            os.write(handle, data)
        finally:
            os.close(handle)
        if size + len(data) > self._max_bytes:
            with suppress(OSError):  # some systems move no file that is open elsewhere: it keeps growing until then
                self._move_aside()

    def _move_aside(self) -> None:
        from filelock import FileLock, Timeout

        with suppress(Timeout), FileLock(self._numbered("lock"), timeout=0):
            if self.path.stat().st_size <= self._max_bytes:
                return  # another process was quicker
            for number in range(N_OLD, 1, -1):
                with suppress(FileNotFoundError):
                    os.replace(self._numbered(number - 1), self._numbered(number))
            os.replace(self.path, self._numbered(1))

    def _numbered(self, number: int | str) -> Path:
        return self.path.with_name(f"{self.path.name}.{number}")


def log_path() -> Path:
    """The program's log file."""
    return data_dir() / "logs" / "clipgstream.log"


def start_logging(path: Path | None = None, *, level: int = logging.INFO) -> Path | None:
    """Send this program's records to a file. Returns the file, or None when the disk refused."""
    path = log_path() if path is None else path
    logging.raiseExceptions = False  # nor does it matter that a stream refuses a record
    handler: logging.Handler = SharedLogHandler(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        SharedLogHandler(path).write(b"")
        found = path
    except (OSError, ValueError):
        handler, found = logging.NullHandler(), None  # without any handler Python writes to standard error
    handler.setFormatter(PrintableFormatter(FORMAT))
    for package in ("app", "engine", "ui"):
        logger = logging.getLogger(package)
        logger.setLevel(level)
        logger.addHandler(handler)
    return found


def tail(path: Path, n_lines: int = 12, *, max_bytes: int = 16_384) -> str:
    """Last lines of a text file; empty when there is none, or something else under its name."""
    try:
        with open_regular(path) as file:
            size = file.seek(0, 2)
            file.seek(max(size - max_bytes, 0))
            text = file.read().decode("utf-8", errors="replace")
    except OSError:
        return ""
    return "\n".join(text.splitlines()[-n_lines:])
