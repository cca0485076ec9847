"""A copy of a project in another folder: complete, or not there at all."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

from app.document.history import DocumentHistory
from app.document.storing.document_file import BACKUP_FILE, PROJECT_FILE
from app.document.storing.document_store import DocumentStore
from app.document.storing.history_file import HISTORY_FILE
from app.document.storing.recovery import DAMAGED_FOLDER
from app.document.storing.replay import JOURNAL_FOLDER
from app.project.folders import check_folders
from app.project.project import LOCK_FILES, Project
from engine.errors import ProjectError
from engine.storage.files import PARTIAL_PREFIX, atomic_folder, disk_error

_LEFT_OUT = {PROJECT_FILE, BACKUP_FILE, HISTORY_FILE, JOURNAL_FOLDER, "live", "logs", *LOCK_FILES}
"""The document is written anew; the rest belongs to a training that runs, or to the past."""
_LINKED = ".safetensors"
"""Such files are never changed, only replaced, so that two projects may share one."""
_BLOCK_BYTES = 8 << 20


def copy_project(project: Project, target: Path, report: Callable[[float, str], None]) -> None:
    """Copy a project with its document and the way back. Large files are shared where the disk allows it.

    Args:
        target: A folder that is not there yet, or an empty one.
        report: Receives the share done and the copied item. An exception from it ends the copying; nothing stays then.
    Raises:
        ProjectError: The folder lies in the project, or holds something; or a folder of the project is a link.
        DiskError: The disk refused; nothing stays.
    """
    check_folders(project.folder, "copied")
    target = target.absolute()
    if target.resolve().is_relative_to(project.folder.resolve()):
        raise ProjectError("A copy cannot be inside the project itself.", hint="Choose another folder.", path=target)
    files = sorted(_files(project.folder))
    n_bytes = max(sum(size for _, size in files), 1)
    done = 0
    try:
        with atomic_folder(target) as partial:
            for path, size in files:
                report(done / n_bytes, path.name)
                place = partial / path.relative_to(project.folder)
                place.parent.mkdir(parents=True, exist_ok=True)
                _copy(path, place, lambda n: report((done + n) / n_bytes, path.name))  # noqa: B023 - called at once
                done += size
            _write_document(project.history, partial, target)
    except FileExistsError as error:
        raise ProjectError(
            "This name is already taken.", hint="Choose a new or an empty folder.", path=target
        ) from error
    except OSError as error:
        raise disk_error(error, what="The copy of the project", path=target) from error


def copy_bytes(project: Path) -> int:
    """The most that a copy takes, bytes."""
    return sum(size for _, size in _files(project))


def _files(folder: Path) -> Iterator[tuple[Path, int]]:
    """Files to copy, with their sizes in bytes. Links are not followed."""
    for child in folder.iterdir():
        if (
            child.is_symlink()
            or child.name in _LEFT_OUT
            or child.name.startswith((f"{DAMAGED_FOLDER}-", PARTIAL_PREFIX))
        ):
            continue
        for path in [child] if child.is_file() else child.rglob("*"):
            if path.is_file() and not path.is_symlink() and not path.name.startswith(PARTIAL_PREFIX):
                yield path, path.stat().st_size


def _copy(path: Path, place: Path, report: Callable[[int], None]) -> None:
    if path.suffix == _LINKED:
        try:
            os.link(path, place)
            return
        except OSError:  # another disk, or one without hard links
            place.unlink(missing_ok=True)
    with path.open("rb") as source, place.open("wb") as copy:
        n = 0
        while block := source.read(_BLOCK_BYTES):
            copy.write(block)
            n += len(block)
            report(n)
    shutil.copystat(path, place)


def _write_document(history: DocumentHistory, partial: Path, target: Path) -> None:
    """Write the document as the folder will hold it under its final name: the way to the capture depends on that."""
    store = DocumentStore(partial, place=target)
    store.begin(history, step=1)
