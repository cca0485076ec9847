"""What the JSON files of a project have in common: a checksum, an upper size, and words for what goes wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from engine.errors import ProjectError
from engine.storage.files import disk_error
from engine.storage.json_files import HAND_EDITED, ChecksumError, JsonError, read_checked_json, write_checked_json

MAX_BYTES = 4 << 20
"""Of settings and of regions; both take some kilobytes."""


def read_kept(path: Path, what: str, *, hint: str, max_bytes: int = MAX_BYTES) -> dict[str, Any] | None:
    """Read a file of a project; None where there is none.

    Args:
        what: Names it at the beginning of a sentence.
        hint: What to do where it is damaged.
    Raises:
        ProjectError: It cannot be read or is damaged.
    """
    try:
        return read_checked_json(path, max_bytes=max_bytes)
    except FileNotFoundError:
        return None
    except (OSError, JsonError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise ProjectError(
            f"{what} cannot be read ({reason}).",
            hint=HAND_EDITED if isinstance(error, ChecksumError) else hint,
            path=path,
        ) from error


def write_kept(path: Path, content: dict[str, Any]) -> None:
    """Write a file of a project, atomically and for good.

    Raises:
        DiskError: The disk refused.
    """
    try:
        write_checked_json(path, content, makes_parents=False, is_durable=True)
    except OSError as error:
        raise disk_error(error, what="The project", path=path) from error
