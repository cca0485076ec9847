"""Atomic files: a complete file appears under its final name, or none does."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np

from engine.errors import DiskError

_DTYPES = {
    **{f"{kind}{bits}": f"{kind[0].upper()}{bits}" for kind in ("int", "uint") for bits in (8, 16, 32, 64)},
    **{f"float{bits}": f"F{bits}" for bits in (16, 32, 64)},
    "bool": "BOOL",
}
"""Names of number types in safetensors files."""


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


@contextmanager
def checked_path(path: Path | str, *, what: str) -> Iterator[Path]:
    """`atomic_path` for files of a project: whatever the disk refuses is a DiskError.

    Args:
        path: As of `atomic_path`.
        what: Names the file in the message, as "The clip".
    Raises:
        DiskError: The disk refused; nothing is left behind.
    """
    try:
        with atomic_path(path) as partial:
            yield partial
    except OSError as error:
        raise disk_error(error, what=what, path=path) from error


def disk_error(error: OSError, *, what: str, path: Path | str) -> DiskError:
    """What to raise when a file could not be written."""
    reason = error.strerror or str(error)
    return DiskError(f"{what} could not be written ({reason}).", hint="Free some space and try again.", path=path)


def write_arrays(path: Path | str, arrays: Mapping[str, np.ndarray], metadata: Mapping[str, str], *, what: str) -> None:
    """Write named arrays as a safetensors file, atomically.

    The package's own writer makes a temporary file under a name that nobody can predict, which a killed process leaves
    behind, and wraps what the system says in an error of its own. Its reader is used to read.

    Args:
        path: As of `atomic_path`.
        arrays: Any shapes; numbers or bool.
        metadata: Texts beside them.
        what: Names the file in the message, as "The clip".
    Raises:
        DiskError: The disk refused; nothing is left behind.
    """
    # widest numbers first keeps all of them aligned
    names = sorted(arrays, key=lambda name: (-arrays[name].dtype.itemsize, name))
    header: dict[str, object] = {"__metadata__": dict(metadata)}
    end = 0
    for name in names:
        start, end = end, end + arrays[name].nbytes
        header[name] = {
            "dtype": _DTYPES[arrays[name].dtype.name],
            "shape": list(arrays[name].shape),
            "data_offsets": [start, end],
        }
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    with checked_path(path, what=what) as partial, partial.open("wb") as file:
        file.write(len(text).to_bytes(8, "little") + text)
        for name in names:
            file.write(np.ascontiguousarray(arrays[name]).view(np.uint8).data if arrays[name].size else b"")
