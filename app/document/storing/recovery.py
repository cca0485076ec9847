"""Recovery: what is left of a project whose document or journal is damaged, and how to continue with it.

Nothing is thrown away: damaged files are kept aside in a folder whose name says so.
"""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass
from pathlib import Path

from app.document.capture_place import found_place, with_capture
from app.document.history import DocumentHistory
from app.document.storing.document_file import (
    BACKUP_FILE,
    PROJECT_FILE,
    DamagedDocument,
    StoredDocument,
    read_stored,
)
from app.document.storing.document_store import DocumentStore
from app.document.storing.history_file import HISTORY_FILE
from app.document.storing.journal_file import JournalDamage
from app.document.storing.replay import JOURNAL_FOLDER, Replayed, journal_steps, replayed, replayed_from
from engine.errors import ProjectError
from engine.storage.files import atomic_folder, disk_error

DAMAGED_FOLDER = "damaged"
"""Prefix of the names of folders with damaged files."""


@dataclass(frozen=True, slots=True)
class Recovery:
    """How a damaged project can be continued.

    Attributes:
        folder: Of the project.
        problem: The damage, in words.
        step: The last step that can be kept; None where nothing can be read.
        step_name: Of that step; empty where unknown.
        is_from_backup: Whether the document comes from the backup of project.json.
        n_replayed: Steps that follow from the journal.
        plain_step: The step of the file that can be opened as it is, read-only; None where there is none.
    """

    folder: Path
    problem: str
    step: int | None
    step_name: str = ""
    is_from_backup: bool = False
    n_replayed: int = 0
    plain_step: int | None = None


class DamagedProject(ProjectError):
    """A project whose document or journal is damaged. recovery: How to continue it; None where nobody has looked."""

    recovery: Recovery | None = None


def damaged_project(folder: Path, error: ProjectError) -> DamagedProject:
    """The same error with the project's recovery."""
    found = DamagedProject(error.message, hint=error.hint, path=error.path)
    found.recovery = look_for_recovery(folder)
    return found


def look_for_recovery(folder: Path) -> Recovery | None:
    """The recovery of a project; None where nothing is damaged. Changes nothing.

    Raises:
        ProjectError: The folder is not a project, or one of a newer version.
    """
    try:
        replayed(folder)
    except (JournalDamage, DamagedDocument) as error:
        return _recovery(folder, error.message)
    return None


def _recovery(folder: Path, problem: str) -> Recovery:
    sources = _sources(folder)
    best = _best(folder, sources)
    if best is None:
        return Recovery(folder, problem, None)
    source, found = best
    history = found.history
    name = history.past[-1].name if history.past else ""
    plain = next(iter(sources.values()))
    return Recovery(folder, problem, found.step, name, source == BACKUP_FILE, found.n_replayed, plain.step)


def _sources(folder: Path) -> dict[str, StoredDocument]:
    found = {}
    for name in (PROJECT_FILE, BACKUP_FILE):
        try:
            found[name] = read_stored(folder, name)
        except ProjectError:
            continue
    return found


def _best(folder: Path, sources: dict[str, StoredDocument]) -> tuple[str, Replayed] | None:
    """The source that leads farthest; the project file where both lead to the same step."""
    found = [(name, replayed_from(folder, stored)) for name, stored in sources.items()]
    return max(found, key=lambda entry: entry[1].step, default=None)


def plain_history(folder: Path) -> DocumentHistory:
    """The document of project.json, or of its backup, as it is; without the journal and without a way back.

    Raises:
        ProjectError: Neither can be read.
    """
    sources = _sources(folder)
    if not sources:
        raise ProjectError("Neither the project file nor its backup can be read.", path=folder)
    stored = next(iter(sources.values()))
    return DocumentHistory(with_capture(stored.document, lambda capture: found_place(capture, folder)))


def recover(folder: Path) -> Path:
    """Continue with the steps before the damage. Only for the holder of the project's lock.

    Returns:
        The folder with the damaged files.
    Raises:
        ProjectError: Nothing can be read.
        DiskError: The disk refused; the project is as damaged as it was.
    """
    best = _best(folder, _sources(folder))
    if best is None:
        raise ProjectError(
            "Neither the project file nor its backup can be read, so the document is lost.",
            hint="Restore project.json from a backup. Clips are not affected.",
            path=folder,
        )
    try:
        aside = _keep_aside(folder)
    except OSError as error:
        raise disk_error(error, what="The copy of the damaged files", path=folder) from error
    store = DocumentStore(folder)
    history = best[1].history.each(lambda document: with_capture(document, lambda place: found_place(place, folder)))
    step = max([best[1].step, *journal_steps(folder)]) + 1  # so that no file that is there continues from it
    store.begin(history, step=step, is_backup_kept=False)
    return aside


def _keep_aside(folder: Path) -> Path:
    """Copy the document's files into a new folder; anything that is not a file is moved there. Raises OSError."""
    number = 1
    while os.path.lexists(folder / f"{DAMAGED_FOLDER}-{number}"):
        number += 1
    aside = folder / f"{DAMAGED_FOLDER}-{number}"
    journal = folder / JOURNAL_FOLDER
    files = [folder / name for name in (PROJECT_FILE, BACKUP_FILE, HISTORY_FILE)]
    files += sorted(journal.iterdir()) if journal.is_dir() else [journal]
    with atomic_folder(aside) as partial:
        for path in files:
            place = partial / path.relative_to(folder)
            place.parent.mkdir(exist_ok=True)
            if path.is_file() and not path.is_symlink():
                shutil.copy2(path, place)
            elif os.path.lexists(path):
                path.rename(place)
    return aside
