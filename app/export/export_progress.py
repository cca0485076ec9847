"""Progress, result and estimate of an export: plain values."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class ExportProgress:
    """Progress of an export.

    Attributes:
        n_done, n_all: In units; nothing is known while n_all is 0.
        unit: The unit of the counts, in the plural: "frames".
        message: The present activity, where that is more than writing units; may be empty.
    """

    n_done: int
    n_all: int
    unit: str = "frames"
    message: str = ""


Report = Callable[[ExportProgress], None]
"""Receives the progress of an export. An exception from it ends the export, which then leaves nothing behind."""


@dataclass(frozen=True, slots=True)
class ExportResult:
    """The result of an export.

    Attributes:
        path: The file, or the folder that was filled.
        n_files, n_bytes: All of them.
        psnr_db: Of the files, read back and rendered, against live pictures; None where nothing is to be measured.
        lines: Sentences that the user should know.
    """

    path: Path
    n_files: int
    n_bytes: int
    psnr_db: float | None = None
    lines: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class ExportEstimate:
    """The expected size of an export.

    Attributes:
        n_files, n_bytes: As far as they can be known beforehand; bytes are an estimate, 0 where there is none.
        lines: Sentences that the user should know.
    """

    n_files: int
    n_bytes: int
    lines: tuple[str, ...] = ()


def written(path: Path, *, psnr_db: float | None = None, lines: tuple[str, ...] = ()) -> ExportResult:
    """The result of a file or folder that is complete."""
    files = [path] if path.is_file() else [found for found in path.rglob("*") if found.is_file()]
    return ExportResult(path, len(files), sum(found.stat().st_size for found in files), psnr_db, lines)
