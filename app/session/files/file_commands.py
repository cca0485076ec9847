"""Commands on the files of a project. Plain data."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class AskSaveAs:
    """Ask where a copy of the open project is to be made."""


@dataclass(frozen=True, slots=True)
class SaveProjectAs:
    """Copy the open project into a new folder and continue in that one."""

    folder: Path


@dataclass(frozen=True, slots=True)
class CancelSaveAs:
    """End the copying; nothing of it stays."""


@dataclass(frozen=True, slots=True)
class ShowProjectFolder:
    """Show the folder of a project in the system's file manager; nothing in it is touched."""

    folder: Path


FileCommand = AskSaveAs | SaveProjectAs | CancelSaveAs | ShowProjectFolder
"""Commands on the files of a project, other than opening it."""
