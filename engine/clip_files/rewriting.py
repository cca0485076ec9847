"""Writing a clip file again with some of its arrays changed: what is read from it is exactly what was given."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from engine.clip_files.clip_state import ClipState, read_coded_arrays, write_clip_state, write_coded_arrays
from engine.clip_files.coding import CodedArray, CodingError, decode_array, encode_array, encode_on_grid_of


def rewrite_clip(source: Path, target: Path, state: ClipState) -> None:
    """Write a clip in the stored form of another file, of which it differs in some arrays. Durable.

    Args:
        source: The file it comes from.
        target: Atomically written.
    Raises:
        ProjectError: The source is damaged.
        DiskError: The disk refused.
    """
    before = read_coded_arrays(source)
    if before is None:
        write_clip_state(target, state, is_durable=True)
        return
    coded = {name: _coded(array, before.get(name)) for name, array in state.arrays.items()}
    write_coded_arrays(target, coded, state.header, is_durable=True)


def _coded(array: np.ndarray, before: CodedArray | None) -> CodedArray:
    """As before where nothing has changed, otherwise exactly and in as few bytes as that takes."""
    if before is None:
        return encode_array(array, "bits" if array.dtype == bool else "exact")
    if _is_same(decode_array(before.payload, before.spec), array):
        return before
    try:
        if before.spec["codec"] not in ("half", "bits"):
            return encode_on_grid_of(array, before)
        coded = encode_array(array, before.spec["codec"])
    except CodingError:
        return encode_array(array, "exact")
    return coded if _is_same(decode_array(coded.payload, coded.spec), array) else encode_array(array, "exact")


def _is_same(one: np.ndarray, other: np.ndarray) -> bool:
    return one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes()
