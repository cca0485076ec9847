"""Log lines of program and training: the ends of their log files, read on a thread."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from app.background.latest import LatestWorker
from app.background.logs import log_path, tail
from engine.text import printable

MAX_LINES = 2000
MAX_BYTES = 256 << 10
"""Read of each file, from its end."""
LEVELS = ("DEBUG", "INFO", "WARNING", "ERROR", "CRITICAL")
_LINE = re.compile(
    r"(\d{4}-\d\d-\d\d \d\d:\d\d:\d\d,\d{3}) (DEBUG|INFO|WARNING|ERROR|CRITICAL) (\S+?): (.*)", re.DOTALL
)


@dataclass(frozen=True, slots=True)
class LogLine:
    """One line.

    Attributes:
        time: As logged; that of the line before where a line has none, as in a traceback.
        level: One of LEVELS; that of the line before likewise.
        source: "program", or "clip 3" for the training of a clip.
        text: The message, with its place in the program.
    """

    time: str
    level: str
    source: str
    text: str


@dataclass(frozen=True, slots=True)
class LogRequest:
    """Where to read. turn: Counts the requests: the same files may have grown."""

    places: tuple[tuple[str, Path], ...]
    turn: int


class LogView:
    """The newest lines. Methods are for one thread and do not wait: the log of a clip may lie on a slow network.

    Args:
        path: The program's log; where it lies on this system when None.
    """

    def __init__(self, path: Path | None = None) -> None:
        self._path = path
        self.worker: LatestWorker[LogRequest, tuple[LogLine, ...]] = LatestWorker("log", self._read)
        self._turn = 0
        self._found: tuple[tuple[str, Path, int, int], ...] = ()  # on the thread, as the next one
        self._lines: tuple[LogLine, ...] = ()

    def lines(self, clip_index: int | None, clip_log: Path | None) -> Sequence[LogLine]:
        """Of the program and of one training, oldest first; those of a moment ago until new ones were read.

        Args:
            clip_index, clip_log: Of the training; None for none.
        """
        self._path = log_path() if self._path is None else self._path
        places = [("program", self._path)] + ([] if clip_log is None else [(f"clip {clip_index}", clip_log)])
        self._turn += 1
        self.worker.request(LogRequest(tuple(places), self._turn))
        newest = self.worker.newest
        return () if newest is None else newest[1]

    def _read(self, request: LogRequest) -> tuple[LogLine, ...]:
        """The same value as long as no file has changed."""
        files = []
        for source, place in request.places:
            with suppress(OSError):
                found = os.stat(place)
                files.append((source, place, found.st_size, found.st_mtime_ns))
        if self._found != tuple(files):
            self._lines, self._found = _merged(files), tuple(files)
        return self._lines

    def close(self) -> None:
        """End the thread."""
        self.worker.close(timeout_s=0.2)


def parse_log(text: str, source: str) -> list[LogLine]:
    """Lines of a log file; one without a time belongs to the line before."""
    lines: list[LogLine] = []
    time, level = "", "INFO"
    for row in text.splitlines():
        found = _LINE.fullmatch(row)
        said = row
        if found is not None:
            time, level = found[1], found[2]
            said = f"{found[3]}: {found[4]}"
        if said.strip():
            lines.append(LogLine(time, level, source, printable(said)))
    return lines


def _merged(files: Sequence[tuple[str, Path, int, int]]) -> tuple[LogLine, ...]:
    lines: list[LogLine] = []
    for source, path, _, _ in files:
        lines += parse_log(tail(path, MAX_LINES, max_bytes=MAX_BYTES), source)
    lines.sort(key=lambda line: line.time)  # stable: lines of one file keep their order
    return tuple(lines[-MAX_LINES:])
