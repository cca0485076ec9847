"""A file of the journal: what has happened to the document since a step, one line for each event.

    {"journal": 1, "step": 123, "document": checksum or null, "after": checksum, "checksum": ...}   what it goes on from
    {"step": 124, "do": "change", "name": ..., "merge": ..., "patch": {...}, "after": ..., "checksum": ...}
    {"step": 125, "do": "undo", "name": ..., "patch": {...}, "after": ..., "checksum": ...}     or "redo"
    {"step": 126, "do": "place", "capture": ..., "follow_links": ..., "after": ..., "checksum": ...}
    {"end": 126, "after": ..., "checksum": ...}

Each line holds the checksum of the line before it as "after", and one of its own over all of it, so that no line can be
changed, left out or moved without being noticed. The last line says that nothing is missing; the next event is written
in its place, with a new last line, in one go. A program that is killed while it writes leaves a file without a last
line, which costs that event alone.
"""

from __future__ import annotations

import json
import os
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from engine.errors import ProjectError
from engine.storage.files import atomic_path, read_bytes
from engine.storage.json_files import CHECKSUM, JsonError, checksum_of, parse_object, without_checksum

FORMAT = 1
MAX_JOURNAL_BYTES = 256 << 20
AFTER = "after"
Row = dict[str, Any]


class JournalDamage(ProjectError):
    """A file of the journal is damaged at a line, or does not fit the others."""


@dataclass(frozen=True, slots=True)
class JournalFile:
    """A file of the journal as it was read.

    Attributes:
        path: The file.
        start: Step that it goes on from.
        document: Checksum of project.json at that step; empty where that was not known.
        after: Checksum of the last line before it, in the file before; empty where there is none.
        rows: Its events, without what chains them.
        links: The checksum of the first line, and then of each event.
        ends: Where each of these lines ends, in bytes.
        is_whole: Whether the last line is there.
        is_left: Whether another file goes on from it.
    """

    path: Path
    start: int
    document: str
    after: str
    rows: tuple[Row, ...]
    links: tuple[str, ...]
    ends: tuple[int, ...]
    is_whole: bool
    is_left: bool

    @property
    def stop(self) -> int:
        """The step that it ends with."""
        return self.start + len(self.rows)

    @property
    def n_bytes(self) -> int:
        """Bytes up to the last line."""
        return self.ends[-1]


def read_journal(path: Path) -> tuple[JournalFile, JournalDamage | None]:
    """Read a file up to its end, or up to where it is damaged.

    Returns:
        What could be read, and what is wrong with the rest. A file that breaks off within a line is not damaged, but
        not whole either.
    Raises:
        JournalDamage: Not even its first line can be read.
    """
    try:
        data = read_bytes(path, max_bytes=MAX_JOURNAL_BYTES)
    except OSError as error:
        raise _damage(path, f"It cannot be read ({error.strerror or error})") from error
    *lines, rest = data.split(b"\n")
    try:
        first = _row(lines[0] if lines else b"", None)
        start, document, after = _header(first)
    except (JsonError, KeyError) as error:
        raise _damage(path, f"Line 1 is damaged ({error})") from error
    link = first[CHECKSUM]
    rows: list[Row] = []
    links, ends = [link], [len(lines[0]) + 1]
    is_whole = is_left = False
    for number, line in enumerate(lines[1:], start=2):
        problem = ""
        try:
            row = _row(line, link)
            if "end" in row:
                if row["end"] != start + len(rows):
                    problem = f"it ends with step {row['end']!r:.20}, after step {start + len(rows)}"
                is_whole, is_left = True, row.get("is_left") is True
            elif row.get("step") != start + len(rows) + 1:
                problem = f"step {row.get('step')!r:.20} follows step {start + len(rows)}"
        except (JsonError, KeyError) as error:
            if number == len(lines) and not rest:  # broken off while it was written
                break
            row, problem = {}, str(error)
        if not problem and is_whole and (rest or number < len(lines)):
            problem, number = "something follows the last line", number + 1
        if problem:
            known = JournalFile(path, start, document, after, tuple(rows), tuple(links), tuple(ends), False, False)
            return known, _damage(path, f"Line {number} is damaged ({problem})", step=start + len(rows))
        if is_whole:
            break
        link = row.pop(CHECKSUM)
        del row[AFTER]
        rows.append(row)
        links.append(link)
        ends.append(ends[-1] + len(line) + 1)
    return JournalFile(path, start, document, after, tuple(rows), tuple(links), tuple(ends), is_whole, is_left), None


def _row(line: bytes, after: str | None) -> Row:
    """A line that fits its checksum and the line before it. Raises JsonError and KeyError."""
    row, checksum = without_checksum(parse_object(line))
    if checksum is None:
        raise JsonError("it has no checksum")
    if after is not None and row.get(AFTER) != after:
        raise JsonError("it does not follow the line before it")
    return {**row, CHECKSUM: checksum}


def _header(row: Row) -> tuple[int, str, str]:
    step, document, after = row["step"], row["document"], row[AFTER]
    if row["journal"] != FORMAT or type(step) is not int or step < 0:
        raise JsonError(f"journal {row['journal']!r:.20}, step {step!r:.20}")
    if not isinstance(document, str) or not isinstance(after, str):
        raise JsonError("a checksum is not a text")
    return step, document, after


def _damage(path: Path, what: str, *, step: int | None = None) -> JournalDamage:
    good = "" if step is None else f" Everything up to step {step} can be read."
    return JournalDamage(f"The journal of the project is damaged. {what}.{good}", path=path)


# ---------------------------------------------------------------- writing


def create_journal(path: Path, step: int, *, document: str, after: str) -> JournalFile:
    """Begin a file without events, durably; see JournalFile.

    Raises:
        OSError: The disk refused.
    """
    first = {"journal": FORMAT, "step": step, "document": document, AFTER: after}
    line, link = _line(first)
    with atomic_path(path, is_durable=True, makes_parents=False) as partial:
        partial.write_bytes(line + _last(step, link))
    return JournalFile(path, step, document, after, (), (link,), (len(line),), True, False)


def append_rows(file: JournalFile, rows: list[Row]) -> JournalFile:
    """Add events, durably.

    Raises:
        ProjectError: They hold something that cannot be kept.
        OSError: The disk refused; the file holds what it held, or breaks off after it.
    """
    data, link = b"", file.links[-1]
    links, ends = list(file.links), list(file.ends)
    for row in rows:
        line, link = _line({**row, AFTER: link})
        data += line
        links.append(link)
        ends.append(ends[-1] + len(line))
    stop = file.stop + len(rows)
    try:
        _write_end(file, data + _last(stop, link))
    except OSError:
        with suppress(OSError):  # what had its place before has it again, and needs no room
            _write_end(file, _last(file.stop, file.links[-1]))
        raise
    return JournalFile(
        file.path, file.start, file.document, file.after, (*file.rows, *rows), tuple(links), tuple(ends), True, False
    )


def leave_journal(file: JournalFile) -> None:
    """Note that another file goes on from this one.

    Raises:
        OSError: The disk refused; the file is as it was, or breaks off after its last event.
    """
    _write_end(file, _last(file.stop, file.links[-1], is_left=True))


def _write_end(file: JournalFile, data: bytes) -> None:
    handle = os.open(file.path, os.O_RDWR | getattr(os, "O_BINARY", 0) | getattr(os, "O_NOFOLLOW", 0))
    try:
        os.lseek(handle, file.n_bytes, os.SEEK_SET)
        rest = memoryview(data)
        while rest:
            rest = rest[os.write(handle, rest) :]
        os.ftruncate(handle, file.n_bytes + len(data))
        os.fsync(handle)
    finally:
        os.close(handle)


def _last(step: int, link: str, *, is_left: bool = False) -> bytes:
    return _line({"end": step, **({"is_left": True} if is_left else {}), AFTER: link})[0]


def _line(row: Row) -> tuple[bytes, str]:
    """A line and its checksum. Raises ProjectError for what JSON cannot hold."""
    try:
        link = checksum_of(row)
        text = json.dumps({**row, CHECKSUM: link}, allow_nan=False, ensure_ascii=False)
        return text.encode("utf-8") + b"\n", link
    except ValueError as error:  # NaN, or half a Unicode character
        raise ProjectError(f"That cannot be kept ({error}).") from error
