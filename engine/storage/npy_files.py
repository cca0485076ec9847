"""Arrays of numbers in .npy files, strictly: no objects, no more than the file holds, bounded in size."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from engine.storage.files import read_bytes


class NpyError(ValueError):
    """Not an array of numbers. The text is a reason that fits into brackets behind a sentence."""


def read_npy(path: Path | str, *, max_bytes: int) -> np.ndarray:
    """The array in a file, read-only.

    Raises:
        OSError: As of `engine.storage.files.read_bytes`.
        NpyError: See `parse_npy`.
    """
    return parse_npy(read_bytes(path, max_bytes=max_bytes))


def parse_npy(data: bytes) -> np.ndarray:
    """The array in the bytes of a .npy file, read-only and without a copy.

    Raises:
        NpyError: Not such a file, not numbers, or of another length than its header says.
    """
    file = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(file)
        if version == (1, 0):
            shape, is_fortran, dtype = np.lib.format.read_array_header_1_0(file)
        elif version == (2, 0):
            shape, is_fortran, dtype = np.lib.format.read_array_header_2_0(file)
        else:
            raise NpyError(f"version {version[0]}.{version[1]} of the file format")
    except NpyError:
        raise
    except Exception as error:
        raise NpyError("it is not a .npy file, or its header is damaged") from error
    if dtype.kind not in "iuf" or dtype.itemsize > 8:
        raise NpyError("it does not hold numbers")
    n_values = 1
    for side in shape:
        if not isinstance(side, int) or isinstance(side, bool) or side < 0:
            raise NpyError("its header is damaged")
        n_values *= side
    start = file.tell()
    if n_values * dtype.itemsize != len(data) - start:
        raise NpyError(f"its header announces {n_values} numbers, {len(data) - start} bytes follow")
    array = np.frombuffer(data, dtype, n_values, start)
    return array.reshape(shape, order="F" if is_fortran else "C")
