"""The window's messages about an export."""

from __future__ import annotations

from dataclasses import dataclass

from app.export.export_progress import ExportProgress, ExportResult


@dataclass(frozen=True, slots=True)
class ExportGoesOn:
    """Progress of the export."""

    progress: ExportProgress


@dataclass(frozen=True, slots=True)
class ExportDone:
    """Everything is written."""

    result: ExportResult


@dataclass(frozen=True, slots=True)
class ExportStopped:
    """The export was cancelled; nothing is left of it."""


@dataclass(frozen=True, slots=True)
class ExportFailed:
    """The export failed; nothing is left of it."""

    message: str
    hint: str = ""


Ending = ExportDone | ExportStopped | ExportFailed
Event = ExportGoesOn | Ending
