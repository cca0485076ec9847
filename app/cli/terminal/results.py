"""Result files of the command line: that they can be written is seen before the work that leads to them."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from engine.errors import ProjectError
from engine.storage.files import atomic_path


def check_writable(path: Path) -> None:
    """See that a result can be written, before the work that leads to it. Makes nothing.

    Raises:
        ProjectError: The path is a folder, or lies where nothing may be written.
    """
    if path.is_dir():
        raise ProjectError("This is a folder, not a file.", hint="Give the name of a file.", path=path)
    folder = next((parent for parent in path.absolute().parents if parent.exists()), Path(path.anchor))
    if not folder.is_dir() or not os.access(folder, os.W_OK):
        reason = "may not be written to" if folder.is_dir() else "is a file"
        raise ProjectError(f"{folder} {reason}.", hint="Choose another place.", path=path)


def write_text(path: Path, text: str) -> None:
    """Write a result complete or not at all. Raises ProjectError where it cannot be written."""
    with named_failure(path), atomic_path(path) as partial:
        partial.write_text(text, encoding="utf-8")


@contextlib.contextmanager
def named_failure(path: Path) -> Iterator[None]:
    """A result that cannot be written is the user's to mend."""
    try:
        yield
    except OSError as error:
        raise ProjectError(
            f"The file could not be written ({error.strerror}).", hint="Choose another place.", path=path
        ) from error
