"""Commands that export for other programs."""

from __future__ import annotations

from dataclasses import dataclass

from app.export.export_choices import ExportChoices


@dataclass(frozen=True, slots=True)
class AskExport:
    """Ask what to export from the open project, and where to."""


@dataclass(frozen=True, slots=True)
class StartExport:
    """Put an export into the queue."""

    choices: ExportChoices


@dataclass(frozen=True, slots=True)
class CancelExport:
    """End an export; its unfinished files disappear."""

    export_id: int


@dataclass(frozen=True, slots=True)
class RetryExport:
    """Begin an export anew that failed or was cancelled."""

    export_id: int


@dataclass(frozen=True, slots=True)
class MoveExport:
    """Bring an export that waits to a place among those that wait."""

    export_id: int
    place: int


@dataclass(frozen=True, slots=True)
class RemoveExport:
    """Take an export that does not run out of the list; its files stay."""

    export_id: int


@dataclass(frozen=True, slots=True)
class ClearExports:
    """Take all exports that have ended out of the list; their files stay."""


@dataclass(frozen=True, slots=True)
class ShowExport:
    """Show the files of an export in the system's file manager."""

    export_id: int


ExportCommand = (
    AskExport | StartExport | CancelExport | RetryExport | MoveExport | RemoveExport | ClearExports | ShowExport
)
"""Commands that export from the project."""
