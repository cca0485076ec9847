"""Atomic files: a complete file appears under its final name, or none does."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def atomic_path(path: Path | str) -> Iterator[Path]:
    """Write to the yielded path; it becomes `path` when the block ends well and disappears when it does not.

    Args:
        path: Final name. Missing folders are made. The suffix is kept, so that writers which look at it work.
    Raises:
        OSError: The disk refused; nothing is left behind.
    """
    path = Path(path)
    partial = path.with_name(f".partial-{os.getpid()}-{path.name}")
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        yield partial
        os.replace(partial, path)
    finally:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
