"""Common parts of a project's JSON files: a checksum, an upper size, and error messages."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from engine.errors import ProjectError
from engine.storage.files import atomic_path, disk_error
from engine.storage.json_files import (
    HAND_EDITED,
    ChecksumError,
    JsonError,
    checked_text,
    read_json_object,
    without_checksum,
)

MAX_BYTES = 4 << 20
"""Of settings and of regions; both take some kilobytes."""


def read_kept(path: Path, what: str, *, hint: str, max_bytes: int = MAX_BYTES) -> dict[str, Any] | None:
    """Read a file of a project; None where there is none.

    Args:
        what: Names it at the beginning of a sentence.
        hint: The remedy where it is damaged.
    Raises:
        ProjectError: It cannot be read or is damaged.
    """
    found = kept_object(path, what, hint=hint, max_bytes=max_bytes)
    return None if found is None else found[0]


def kept_object(path: Path, what: str, *, hint: str, max_bytes: int) -> tuple[dict[str, Any], str | None] | None:
    """Likewise, with the checksum of the file; None for that where somebody has taken it out."""
    try:
        return without_checksum(read_json_object(path, max_bytes=max_bytes))
    except FileNotFoundError:
        return None
    except (OSError, JsonError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise ProjectError(
            f"{what} cannot be read ({reason}).",
            hint=HAND_EDITED if isinstance(error, ChecksumError) else hint,
            path=path,
        ) from error


@dataclass(frozen=True, slots=True)
class KeptText:
    """The text to write, and the checksum in it."""

    data: bytes
    checksum: str


def kept_text(content: dict[str, Any], *, max_bytes: int = MAX_BYTES, is_for_people: bool = True) -> KeptText:
    """A file of a project as it is written. max_bytes: The limit for reading it. is_for_people: See `checked_text`.

    Raises:
        ProjectError: It would be too large, or holds values that JSON cannot hold.
    """
    try:
        text, checksum = checked_text(content, is_for_people=is_for_people)
        data = text.encode("utf-8")
    except ValueError as error:  # NaN, or half a Unicode character
        raise ProjectError(f"This cannot be saved ({error}).") from error
    if len(data) > max_bytes:
        raise ProjectError(
            f"The project would take {len(data) / 1e6:.0f} MB, at most {max_bytes / 1e6:.0f} are kept.",
            hint="Delete what is not needed.",
        )
    return KeptText(data, checksum)


def write_kept(path: Path, text: KeptText) -> None:
    """Write a file of a project, atomically and for good.

    Raises:
        DiskError: The disk refused.
    """
    try:
        with atomic_path(path, makes_parents=False, is_durable=True) as partial:
            partial.write_bytes(text.data)
    except OSError as error:
        raise disk_error(error, what="The project", path=path) from error
