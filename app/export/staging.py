"""Where exports are written: seen to be possible before the work starts, and complete or not there at all."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from app.project.lock import is_process_alive
from engine.errors import DiskError, ProjectError
from engine.storage.files import atomic_folder, atomic_path, discard, disk_error, is_left_over

if TYPE_CHECKING:
    from app.evaluation.headless import TrainedProject

SPARE_BYTES = 16 << 20
"""Of the disk, which stay free whatever is written; less where less is written: a table is not held up by it."""
LEAST_SPARE_BYTES = 256 << 10


def check_target(
    path: Path, *, opened: TrainedProject | None = None, n_bytes: int = 0, is_folder: bool = False
) -> None:
    """Check that an export can be written, before the work that leads to it. Makes nothing.

    Args:
        opened: The open project; nothing is written into it or its capture, where a file could take the place
            of one of theirs, or be taken for one.
        path: The destination: a file, which may be there already and is replaced, or a new or empty folder.
        n_bytes: Its expected size, as far as known.
        is_folder: Which of the two it is.
    Raises:
        ProjectError: Something else has this name, or the place may not be written to.
        DiskError: The disk has too little room.
    """
    if opened is not None:
        _check_apart(path, opened)
    if is_folder and (path.is_symlink() or path.exists()) and not _is_empty_folder(path):
        raise ProjectError("This name is already taken.", hint="Give a new folder.", path=path)
    if not is_folder and path.is_dir():
        raise ProjectError("This is a folder, not a file.", hint="Give the name of a file.", path=path)
    parent = next((parent for parent in path.absolute().parents if parent.exists()), Path(path.anchor))
    if not parent.is_dir() or not os.access(parent, os.W_OK | os.X_OK):
        reason = "may not be written to" if parent.is_dir() else "is a file"
        raise ProjectError(f"{parent} {reason}.", hint="Choose another place.", path=path)
    disk = shutil.disk_usage(parent)
    if disk.total == 0:
        raise ProjectError(f"{parent} cannot hold files.", hint="Choose another place.", path=path)
    spare_bytes = min(SPARE_BYTES, LEAST_SPARE_BYTES + n_bytes)
    if n_bytes + spare_bytes > disk.free:
        needed = f"About {_room(n_bytes)} will be written" if n_bytes else f"{_room(spare_bytes)} must be free"
        raise DiskError(
            f"{needed}, but only {_room(disk.free)} are free.",
            hint="Free some space, choose another place, or export fewer frames.",
            path=path,
        )


def _room(n_bytes: int) -> str:
    """Bytes in words that do not round to nothing."""
    return f"{n_bytes / 1e6:,.0f} MB" if n_bytes >= 9.5e5 else f"{n_bytes / 1e3:.0f} kB"


def _check_apart(path: Path, opened: TrainedProject) -> None:
    for what, folder in (("project", opened.project.folder), ("capture", Path(opened.capture.path))):
        if path.resolve().is_relative_to(folder.resolve()):
            raise ProjectError(
                f"This place is inside the {what} that is exported.", hint="Choose another place.", path=path
            )


def _is_empty_folder(path: Path) -> bool:
    try:
        return path.is_dir() and not path.is_symlink() and not any(path.iterdir())
    except OSError:
        return False


@contextmanager
def staged_file(path: Path, *, what: str = "The file") -> Iterator[Path]:
    """Write to the yielded path; it becomes `path` when the block ends well, and disappears when it does not.

    Remains of the same file that killed programs have left next to it are removed first.

    Args:
        what: Names the file in a message.
    Raises:
        DiskError: The disk refused; nothing is left behind.
    """
    _sweep(path)
    try:
        with atomic_path(path) as partial:
            yield partial
    except OSError as error:
        raise disk_error(error, what=what, path=path) from error


@contextmanager
def staged_folder(path: Path, *, what: str = "The folder") -> Iterator[Path]:
    """Fill the yielded folder; it becomes `path`, which is new or empty, when the block ends well. See `staged_file`.

    Raises:
        DiskError: The disk refused, or something else has this name by now; nothing is left behind.
    """
    _sweep(path)
    try:
        with atomic_folder(path) as partial:
            yield partial
    except OSError as error:
        raise disk_error(error, what=what, path=path) from error


def _sweep(path: Path) -> None:
    with suppress(OSError):
        for beside in path.absolute().parent.iterdir():
            if is_left_over(beside, is_process_alive, of=path.name):
                discard(beside)
