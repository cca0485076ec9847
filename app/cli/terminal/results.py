"""Result files of the command line, complete or not there at all; app.export.staging sees before that they can be."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from engine.errors import ProjectError
from engine.storage.files import atomic_path


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
