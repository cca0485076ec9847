"""Headers of clip files, each read once for as long as its file stays as it is. Knows no project, and of the arrays
only how far the cameras' exposure is from the reference clip's."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path

from msgspec import structs

from engine.clip_files.clip_header import ClipHeader
from engine.clip_files.clip_state import look_at_clip
from engine.clip_files.kept_drift import mean_change, read_drift
from engine.errors import ProjectError

_ALIKE = ("camera_names", "decoder", "reference_fingerprint")
"""Entries that most clips of a project have in common."""


@dataclass(frozen=True, slots=True)
class FoundHeader:
    """The header of a clip file, or its damage. Shared between readers: nobody changes it.

    Attributes:
        header: None when the file is damaged.
        damage: The fault of the file; empty for a good one.
        n_bytes: Size of the file.
        exposure_change: Of a finished clip, see engine.clip_files.kept_drift.mean_change; None elsewhere.
    """

    header: ClipHeader | None
    damage: str
    n_bytes: int
    exposure_change: float | None = None


class HeaderCache:
    """Headers by path, read again when time or size of a file has changed. May be used by several threads."""

    def __init__(self) -> None:
        self._known: dict[Path, tuple[tuple[int, int, int], FoundHeader]] = {}
        self._last: ClipHeader | None = None

    def __len__(self) -> int:
        return len(self._known)

    def read(self, path: Path) -> FoundHeader | None:
        """The header of a clip, checkpoint or snapshot; None when there is no such file."""
        try:
            status = os.stat(path)
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as error:
            return FoundHeader(None, f"The file cannot be read ({error.strerror}).", 0)
        identity = (status.st_mtime_ns, status.st_size, status.st_ino)
        known = self._known.get(path)
        if known is None or known[0] != identity:
            found = _read(path, status.st_size)
            if found.header is not None:
                self._last = header = _sharing(found.header, self._last)
                found = replace(found, header=header)
            known = (identity, found)
            self._known[path] = known  # one assignment: another thread sees the old entry or the new one
        return known[1]


def _sharing(header: ClipHeader, other: ClipHeader | None) -> ClipHeader:
    """The same, with what is equal in both kept once: clips may be thousands, and name the same cameras."""
    if other is None:
        return header
    equal = {name: kept for name in _ALIKE if getattr(header, name) == (kept := getattr(other, name))}
    return structs.replace(header, **equal)


def _read(path: Path, n_bytes: int) -> FoundHeader:
    found = look_at_clip(path)
    if isinstance(found, ClipHeader):
        return FoundHeader(found, "", n_bytes, None if found.metrics is None else _exposure_change(path))
    reason = "it no longer exists" if found is None else found.reason
    return FoundHeader(None, f"The file is damaged ({reason}).", n_bytes)


def _exposure_change(path: Path) -> float | None:
    try:
        return mean_change(read_drift(path))
    except ProjectError:  # damage of arrays is reported where they are needed
        return None
