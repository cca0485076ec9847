"""Named arrays and texts in safetensors files, with a checksum over all of it.

The checksum is a text among the others: eight hexadecimal digits for the texts and the names, types and shapes of all
arrays, then eight for each array in the order of their names. Files of earlier versions have none.
"""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np
from safetensors import SafetensorError, safe_open

from engine.storage.files import check_regular, checked_path

_DTYPES = {
    **{f"{kind}{bits}": f"{kind[0].upper()}{bits}" for kind in ("int", "uint") for bits in (8, 16, 32, 64)},
    **{f"float{bits}": f"F{bits}" for bits in (16, 32, 64)},
    "bool": "BOOL",
}
"""Names of number types in safetensors files."""
_ITEM_BYTES = {name: np.dtype(kind).itemsize for kind, name in _DTYPES.items()}
Table = dict[str, tuple[str, list[int]]]
"""Type and shape of each array of a file."""
_CHECKSUM = "checksum"
_DIGITS = 8


class ArraysError(ValueError):
    """Not a file of arrays as this program writes them, or damaged. The text is a reason that fits into brackets."""


def write_arrays(
    path: Path | str,
    arrays: Mapping[str, np.ndarray],
    metadata: Mapping[str, str],
    *,
    what: str,
    is_durable: bool = False,
) -> None:
    """Write named arrays as a safetensors file with a checksum, atomically.

    The package's own writer makes a temporary file under a name that nobody can predict, which a killed process leaves
    behind, and wraps what the system says in an error of its own. Its reader is used to read.

    Args:
        path, is_durable: As of `engine.storage.files.atomic_path`.
        arrays: Any shapes; numbers or bool.
        metadata: Texts next to them.
        what: Names the file in the message, as "The clip".
    Raises:
        DiskError: The disk refused; nothing is left behind.
    """
    # widest numbers first keeps all of them aligned
    names = sorted(arrays, key=lambda name: (-arrays[name].dtype.itemsize, name))
    table: Table = {name: (_DTYPES[array.dtype.name], list(array.shape)) for name, array in arrays.items()}
    sums = "".join(_sum_of(arrays[name]) for name in sorted(arrays))
    header: dict[str, object] = {"__metadata__": {**metadata, _CHECKSUM: _sum_of_header(metadata, table, sums) + sums}}
    end = 0
    for name in names:
        start, end = end, end + arrays[name].nbytes
        dtype, shape = table[name]
        header[name] = {"dtype": dtype, "shape": shape, "data_offsets": [start, end]}
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    with checked_path(path, what=what, is_durable=is_durable) as partial, partial.open("wb") as file:
        file.write(len(text).to_bytes(8, "little") + text)
        for name in names:
            file.write(_bytes_of(arrays[name]))


def read_arrays(
    path: Path | str, entries: Collection[str], *, only: Collection[str] | None = None
) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Arrays and texts of a file.

    Args:
        entries: Names that its texts may have; another one is damage.
        only: Arrays to read, as far as they are there; all of them when None.
    Raises:
        OSError: The file is missing, cannot be read, or is not a regular file.
        ArraysError: It is damaged, or something else.
    """
    arrays, metadata, _ = _read(path, entries, only)
    return arrays, metadata


def read_metadata(path: Path | str, entries: Collection[str]) -> tuple[dict[str, str], dict[str, int]]:
    """The texts of a file and the bytes that each array takes, without a look at the arrays.

    Args and Raises: as of `read_arrays`.
    """
    _, metadata, table = _read(path, entries, ())
    return metadata, {name: math.prod(shape) * _ITEM_BYTES[dtype] for name, (dtype, shape) in table.items()}


def _read(
    path: Path | str, entries: Collection[str], only: Collection[str] | None
) -> tuple[dict[str, np.ndarray], dict[str, str], Table]:
    check_regular(path)
    arrays: dict[str, np.ndarray] = {}
    try:
        with safe_open(path, framework="numpy") as file:
            metadata = dict(file.metadata() or {})
            names = sorted(file.keys())
            slices = {name: file.get_slice(name) for name in names}
            table = {name: (str(part.get_dtype()), list(part.get_shape())) for name, part in slices.items()}
            unknown = sorted(metadata.keys() - {*entries, _CHECKSUM})
            if unknown:
                raise ArraysError(f"unknown entry {unknown[0][:40]!r}")
            odd = sorted({dtype for dtype, _ in table.values()} - set(_DTYPES.values()))
            if odd:
                raise ArraysError(f"numbers of type {odd[0]}")
            stated = metadata.pop(_CHECKSUM, None)
            sums = _checked_sums(stated, metadata, table)
            for i, name in enumerate(names):
                if only is not None and name not in only:
                    continue
                arrays[name] = file.get_tensor(name)
                if sums is not None and _sum_of(arrays[name]) != sums[_DIGITS * i : _DIGITS * (i + 1)]:
                    raise ArraysError(f"the numbers of {name} do not fit their checksum")
    except SafetensorError as error:
        raise ArraysError(str(error).removeprefix("Error while deserializing header: ")) from error
    return arrays, metadata, table


def _checked_sums(stated: str | None, metadata: Mapping[str, str], table: Table) -> str | None:
    """The checksums of the arrays, after a look at that of everything else; None where there are none.

    Raises:
        ArraysError: It does not fit.
    """
    if stated is None:
        return None
    sums = stated[_DIGITS:]
    if len(sums) != _DIGITS * len(table) or stated[:_DIGITS] != _sum_of_header(metadata, table, sums):
        raise ArraysError("the header does not fit its checksum")
    return sums


def _sum_of_header(metadata: Mapping[str, str], table: Table, sums: str) -> str:
    covered = [dict(metadata), {name: list(entry) for name, entry in table.items()}, sums]
    return _hex(json.dumps(covered, sort_keys=True).encode())


def _sum_of(array: np.ndarray) -> str:
    return _hex(_bytes_of(array))


def _bytes_of(array: np.ndarray) -> bytes | memoryview:
    return np.ascontiguousarray(array).reshape(-1).view(np.uint8).data if array.size else b""


def _hex(data: bytes | memoryview) -> str:
    return f"{zlib.crc32(data):0{_DIGITS}x}"
