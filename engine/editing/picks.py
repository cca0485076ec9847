"""Numbers of Gaussians, packed for a document: rising, as differences, in few bytes."""

from __future__ import annotations

import zlib
from functools import lru_cache

import numpy as np

MAX_PICKED = 1 << 26
"""Gaussians of one anchor set."""


def pack_rows(rows: np.ndarray) -> bytes:
    """Pack numbers; those that occur twice count once. rows: [N] integers, not negative"""
    rising = np.unique(np.asarray(rows, dtype=np.int64))
    if len(rising) and not (rising[0] >= 0 and rising[-1] < MAX_PICKED):
        raise ValueError(
            f"numbers of Gaussians run from {rising[0]} to {rising[-1]}; the range is 0 to {MAX_PICKED - 1}"
        )
    return zlib.compress(np.diff(rising, prepend=0).astype("<u4").tobytes(), 9)


def unpack_rows(packed: bytes) -> np.ndarray:
    """The packed rows, rising. [N] int64

    Raises:
        ValueError: These bytes are not from `pack_rows`.
    """
    try:
        unpacker = zlib.decompressobj()
        data = unpacker.decompress(packed, 4 * MAX_PICKED)
    except zlib.error as error:
        raise ValueError("the numbers of picked Gaussians are damaged") from error
    if not unpacker.eof or unpacker.unused_data or len(data) % 4:
        raise ValueError("the numbers of picked Gaussians are damaged")
    steps = np.frombuffer(data, "<u4").astype(np.int64)
    rows = np.cumsum(steps)
    if len(rows) and (rows[-1] >= MAX_PICKED or (steps[1:] == 0).any()):
        raise ValueError("the numbers of picked Gaussians are damaged")
    return rows


@lru_cache(maxsize=256)
def n_rows(packed: bytes) -> int:
    """How many were packed. Raises ValueError as `unpack_rows` does."""
    return len(unpack_rows(packed))
