"""A file of the journal: the events since a step of the document, one line each.

    {"journal": 2, "step": 123, "document": checksum or null, "after": checksum, "checksum": ...}   its start
    {"kept": 127             , "checksum": ...}                                                     its last step
    {"step": 124, "do": "change", "name": ..., "merge": ..., "patch": {...}, "after": ..., "checksum": ...}
    {"step": 125, "do": "undo", "name": ..., "patch": {...}, "after": ..., "checksum": ...}     or "redo"
    {"step": 126, "do": "place", "capture": ..., "follow_links": ..., "frames": ..., "after": ..., "checksum": ...}
    {"step": 127, "do": "find", "object": 3, "patch": {...}, "after": ..., "checksum": ...}
    {"end": 127, "after": ..., "checksum": ...}

Each line holds the checksum of the line before it as "after", and its own checksum over all of it, so that no line can
be changed, left out or moved without being noticed. The last line says that nothing is missing; the next event is
written in its place, with a new last line, in one go. A program that is killed while it writes leaves a file without a
last line, which costs that event alone. The second line, of a fixed length and not part of the chain, names the last
step that was kept, so that a file that is cut off later shows how many are missing. Files of format 1 have none.
"""

from __future__ import annotations

import json
import os
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from engine.errors import ProjectError
from engine.storage.files import atomic_path, read_bytes
from engine.storage.json_files import CHECKSUM, JsonError, checksum_of, parse_object, without_checksum

FORMAT, WITHOUT_COUNT = 2, 1
MAX_JOURNAL_BYTES = 256 << 20
SETTLING_S = 0.01
"""An event is written over the last line while others may read. A file counts as damaged or broken off only where it
is still the same after this time."""
AFTER = "after"
Row = dict[str, Any]


class JournalDamage(ProjectError):
    """A file of the journal is damaged at a line, or does not fit the others."""


@dataclass(frozen=True, slots=True)
class JournalFile:
    """A file of the journal as it was read.

    Attributes:
        path: The file.
        start: Step that it continues from.
        document: Checksum of project.json at that step; empty where that was not known.
        after: Checksum of the last line before it, in the file before; empty where there is none.
        rows: Its events, without the checksums that chain them.
        links: The checksum of the first line, and then of each event.
        ends: Where each of these lines ends, in bytes.
        is_whole: Whether the last line is there.
        is_left: Whether another file continues from it.
        n_head: Lines before the first event.
        kept: The last step that was kept, as its second line has it; None where it has none, or a damaged one.
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
    n_head: int
    kept: int | None

    @property
    def stop(self) -> int:
        """The step that it ends with."""
        return self.start + len(self.rows)

    @property
    def can_go_on(self) -> bool:
        """Whether events can be added: not where the second line is damaged."""
        return self.n_head == 1 or self.kept is not None

    @property
    def n_missing(self) -> int | None:
        """Steps that it has held and does not hold any more; None where that is not known."""
        if self.is_whole:
            return 0
        return None if self.kept is None else max(self.kept - self.stop, 0)

    @property
    def n_bytes(self) -> int:
        """Bytes up to the last line."""
        return self.ends[-1]


def read_journal(path: Path) -> tuple[JournalFile, JournalDamage | None]:
    """Read a file up to its end, or up to where it is damaged.

    Returns:
        The readable part, and the damage in the rest. A file that breaks off within a line is not damaged, but
        not whole either.
    Raises:
        JournalDamage: Not even its first line can be read.
    """
    data = _bytes_of(path)
    while True:
        known, damage = _parsed(path, data)
        if known is not None and known.is_whole and damage is None:
            return known, None
        time.sleep(SETTLING_S)
        before, data = data, _bytes_of(path)
        if data != before:
            continue
        if known is None:
            assert damage is not None
            raise damage
        return known, damage


def _bytes_of(path: Path) -> bytes:
    try:
        return read_bytes(path, max_bytes=MAX_JOURNAL_BYTES)
    except OSError as error:
        raise _damage(path, f"It cannot be read ({error.strerror or error})") from error


def _parsed(path: Path, data: bytes) -> tuple[JournalFile | None, JournalDamage | None]:
    """As read_journal returns it, from what the file holds; no file where its first line cannot be read."""
    *lines, rest = data.split(b"\n")
    try:
        first = _row(lines[0] if lines else b"", None)
        start, document, after, has_count = _header(first)
    except (JsonError, KeyError) as error:
        return None, _damage(path, f"Line 1 is damaged ({error})")
    link = first[CHECKSUM]
    rows: list[Row] = []
    n_head = 2 if has_count else 1
    kept = _kept(lines[1]) if has_count and len(lines) > 1 else None
    links, ends = [link], [sum(len(line) + 1 for line in lines[:n_head])]
    is_whole = is_left = False
    damage: JournalDamage | None = None
    for number, line in enumerate(lines[n_head:], start=n_head + 1):
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
            damage = _damage(path, f"Line {number} is damaged ({problem})", step=start + len(rows))
            is_whole = is_left = False
            break
        if is_whole:
            break
        link = row.pop(CHECKSUM)
        del row[AFTER]
        rows.append(row)
        links.append(link)
        ends.append(ends[-1] + len(line) + 1)
    known = JournalFile(
        path, start, document, after, tuple(rows), tuple(links), tuple(ends), is_whole, is_left, n_head, kept
    )
    return known, damage


def _row(line: bytes, after: str | None) -> Row:
    """A line that fits its checksum and the line before it. Raises JsonError and KeyError."""
    row, checksum = without_checksum(parse_object(line))
    if checksum is None:
        raise JsonError("it has no checksum")
    if after is not None and row.get(AFTER) != after:
        raise JsonError("it does not follow the line before it")
    return {**row, CHECKSUM: checksum}


def _header(row: Row) -> tuple[int, str, str, bool]:
    step, document, after = row["step"], row["document"], row[AFTER]
    if row["journal"] not in (FORMAT, WITHOUT_COUNT) or type(step) is not int or step < 0:
        raise JsonError(f"journal {row['journal']!r:.20}, step {step!r:.20}")
    if not isinstance(document, str) or not isinstance(after, str):
        raise JsonError("a checksum is not a text")
    return step, document, after, row["journal"] != WITHOUT_COUNT


def _kept(line: bytes) -> int | None:
    """The last step that was kept; None where the line is damaged."""
    try:
        row, checksum = without_checksum(parse_object(line))
    except JsonError:
        return None
    step = row.get("kept")
    return step if checksum is not None and type(step) is int and line + b"\n" == _kept_line(step) else None


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
    line += _kept_line(step)
    with atomic_path(path, is_durable=True, makes_parents=False) as partial:
        partial.write_bytes(line + _last(step, link))
    return JournalFile(path, step, document, after, (), (link,), (len(line),), True, False, 2, step)


def append_rows(file: JournalFile, rows: list[Row]) -> JournalFile:
    """Add events, durably.

    Raises:
        ProjectError: They hold something that cannot be kept.
        OSError: The disk refused; the file is as it was, or breaks off after its last event.
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
        _write_end(file, data + _last(stop, link), stop)
    except OSError:
        with suppress(OSError):  # the last line from before returns to its place, which needs no room
            _write_end(file, _last(file.stop, file.links[-1]), file.stop)
        raise
    return replace(
        file,
        rows=(*file.rows, *rows),
        links=tuple(links),
        ends=tuple(ends),
        is_whole=True,
        is_left=False,
        kept=None if file.kept is None else stop,
    )


def leave_journal(file: JournalFile) -> None:
    """Note that another file continues from this one.

    Raises:
        OSError: The disk refused; the file is as it was, or breaks off after its last event.
    """
    _write_end(file, _last(file.stop, file.links[-1], is_left=True), file.stop)


def _write_end(file: JournalFile, data: bytes, stop: int) -> None:
    handle = os.open(file.path, os.O_RDWR | getattr(os, "O_BINARY", 0) | getattr(os, "O_NOFOLLOW", 0))
    try:
        os.lseek(handle, file.n_bytes, os.SEEK_SET)
        rest = memoryview(data)
        while rest:
            rest = rest[os.write(handle, rest) :]
        os.ftruncate(handle, file.n_bytes + len(data))
        if file.kept is not None:
            count = _kept_line(stop)
            os.lseek(handle, file.ends[0] - len(count), os.SEEK_SET)
            os.write(handle, count)  # after the events: it never names a step that was not kept
        os.fsync(handle)
    finally:
        os.close(handle)


def _kept_line(step: int) -> bytes:
    """Always as long: it is written over in its place."""
    return f'{{"kept": {step:<16d}, "{CHECKSUM}": "{checksum_of({"kept": step})}"}}\n'.encode()


def _last(step: int, link: str, *, is_left: bool = False) -> bytes:
    return _line({"end": step, **({"is_left": True} if is_left else {}), AFTER: link})[0]


def _line(row: Row) -> tuple[bytes, str]:
    """A line and its checksum. Raises ProjectError for values that JSON cannot hold."""
    try:
        link = checksum_of(row)
        text = json.dumps({**row, CHECKSUM: link}, allow_nan=False, ensure_ascii=False)
        return text.encode("utf-8") + b"\n", link
    except ValueError as error:  # NaN, or half a Unicode character
        raise ProjectError(f"This cannot be saved ({error}).") from error
