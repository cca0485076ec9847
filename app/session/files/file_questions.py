"""Questions about the files of a project: plain values with all that the answer depends on."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from app.document.storing.recovery import Recovery


@dataclass(frozen=True, slots=True)
class RecoveryQuestion:
    """How to continue with a project whose document or journal is damaged?

    Attributes:
        recovery: The damage, and how to continue.
    """

    recovery: Recovery


@dataclass(frozen=True, slots=True)
class RelocationQuestion:
    """Where does the capture of a project lie by now?

    Attributes:
        project: The project's folder.
        capture: Where the capture was.
        refused: A folder that was named and holds another capture; None before one was.
    """

    project: Path
    capture: Path
    refused: Path | None = None


@dataclass(frozen=True, slots=True)
class SaveAsQuestion:
    """Where is a copy of the open project to be made?

    Attributes:
        project: Its folder.
        suggestion: A folder that is not there yet.
        n_bytes: Most that a copy takes.
    """

    project: Path
    suggestion: Path
    n_bytes: int


SAVING = "Saving the project"
"""Name of the job."""


@dataclass(frozen=True, slots=True)
class SavingQuestion:
    """Is the project to continue being copied? It is up while that is done.

    Attributes:
        folder: Of the copy.
    """

    folder: Path


FileQuestion = RecoveryQuestion | RelocationQuestion | SaveAsQuestion | SavingQuestion
