"""Temporary folders for the files that cross between processes: arrays, which are too large for messages."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from engine.storage.files import disk_error


@contextmanager
def child_folder(prefix: str, *, what: str) -> Iterator[Path]:
    """A temporary folder for what a child reads and writes; removed at the end. Those of killed processes go first.

    Args:
        prefix: Begins its name; no other use has the same.
        what: Subject of the message when the disk refuses.
    Raises:
        DiskError: There is no room for it.
    """
    remove_leftovers(prefix)
    try:
        folder = Path(tempfile.mkdtemp(prefix=f"{prefix}{os.getpid()}-"))
    except OSError as error:
        raise disk_error(error, what=what, path=tempfile.gettempdir()) from error
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def remove_leftovers(prefix: str) -> None:
    """Remove the temporary folders of processes that were killed."""
    for folder in Path(tempfile.gettempdir()).glob(f"{prefix}*"):
        pid = folder.name.removeprefix(prefix).partition("-")[0]
        if pid.isdecimal() and os.name == "posix" and not _is_alive(int(pid)):
            shutil.rmtree(folder, ignore_errors=True)


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # somebody else's, or no process id at all
        return True
    return True
