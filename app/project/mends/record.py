"""MendRecord: the mended place, the means, and figures before and after; mends/0001.json in the project."""

from __future__ import annotations

import os
from datetime import datetime
from pathlib import Path
from typing import Annotated

import msgspec
from msgspec import Meta, to_builtins

from app.document.storing.kept_json import kept_text, read_kept, write_kept
from app.project.project import Project
from engine.errors import ProjectError
from engine.mending.figures import Attempt, StretchFigures
from engine.storage.files import disk_error
from engine.storage.typed_json import EntryError, to_type

SCHEMA = 1
UNFINISHED = "unfinished.json"
"""Next to the records, while mended clips are put in their place."""
MAX_KEPT = 50
"""Records beyond that go, the oldest first; they are about clips long gone."""
_HINT = "Remove it; nothing else depends on it."
_Index = Annotated[int, Meta(ge=0, lt=2**31)]


class MendedClip(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A clip that changed: its index, and the fingerprints of its files."""

    clip_index: _Index
    before: str
    after: str


class MendRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The outcome of mending once. A value.

    Attributes:
        words: The mended place, as "the seam at frame 20".
        first, stop: Frames that the stretch covers.
        clips: Those that changed; none where nothing helped.
        before, after: Figures.
        attempts: All that was tried, in order.
        diagnosis: The component that jumps, in a sentence.
        advice: Other remedies; empty where enough was reached.
        seconds: Its duration.
        made: When, as ISO 8601 with minutes.
    """

    words: str
    first: _Index
    stop: _Index
    clips: tuple[MendedClip, ...]
    before: StretchFigures
    after: StretchFigures
    attempts: tuple[Attempt, ...]
    diagnosis: str
    advice: str
    seconds: float
    made: str = ""

    @property
    def has_helped(self) -> bool:
        """Whether a clip changed."""
        return bool(self.clips)


def now_text() -> str:
    """This moment as a record has it."""
    return datetime.now().isoformat(timespec="minutes")


def records_dir(project: Project) -> Path:
    """The folder of records."""
    return project.folder / "mends"


def keep_record(project: Project, record: MendRecord) -> int:
    """Keep a record; returns its number.

    Raises:
        DiskError: The disk refused.
    """
    folder = records_dir(project)
    numbers = record_numbers(project)
    number = max(numbers, default=0) + 1
    write_record(folder / f"{number:04d}.json", record)
    for old in numbers[: max(0, len(numbers) + 1 - MAX_KEPT)]:
        (folder / f"{old:04d}.json").unlink(missing_ok=True)
    return number


def record_numbers(project: Project) -> list[int]:
    """Of all records, rising."""
    try:
        names = os.listdir(records_dir(project))
    except OSError:
        return []
    stems = [name.removesuffix(".json") for name in names if name.endswith(".json")]
    return sorted(int(stem) for stem in stems if stem.isascii() and stem.isdecimal() and 4 <= len(stem) <= 9)


def kept_record(project: Project, number: int) -> MendRecord | None:
    """A record; None where there is none.

    Raises:
        ProjectError: It is damaged.
    """
    return read_record(records_dir(project) / f"{number:04d}.json")


def write_record(path: Path, record: MendRecord) -> None:
    """Write a record for good, atomically.

    Raises:
        DiskError: The disk refused.
    """
    try:
        path.parent.mkdir(exist_ok=True)  # not the project itself, which may be gone
    except OSError as error:
        raise disk_error(error, what="The mending record", path=path) from error
    write_kept(path, kept_text({"schema": SCHEMA, **to_builtins(record, str_keys=True)}))


def read_record(path: Path) -> MendRecord | None:
    """Inverse of `write_record`; None where there is no file.

    Raises:
        ProjectError: It is damaged, or of another schema.
    """
    content = read_kept(path, "The mending record", hint=_HINT)
    if content is None:
        return None
    if content.pop("schema", None) != SCHEMA:
        raise ProjectError("The mending record is of another schema.", hint=_HINT, path=path)
    try:
        return to_type(content, MendRecord)
    except EntryError as error:
        message = f"The mending record has a missing or wrong entry ({error})."
        raise ProjectError(message, hint=_HINT, path=path) from error
