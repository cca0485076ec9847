"""ProjectChoices: how a project is opened. A plain value, for commands."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class ProjectChoices:
    """The way a project is opened.

    Attributes:
        is_read_only: Only to look at it.
        is_journal_used: False for the document as it was when project.json was written last; read-only.
        is_repaired: First continue with the steps before the damaged part, and keep that part aside.
        capture: The present place of its capture; None where it lies where the project says.
    """

    is_read_only: bool = False
    is_journal_used: bool = True
    is_repaired: bool = False
    capture: Path | None = None


AS_USUAL = ProjectChoices()
