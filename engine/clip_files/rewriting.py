"""Writing a clip file again with some of its arrays changed: what is read from it is exactly what was given."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from engine.clip_files.clip_state import ClipState, read_coded_arrays, write_clip_state, write_coded_arrays
from engine.clip_files.coding import CodedArray, CodingError, decode_array, encode_array

_EXACT_HERE = ("half", "bits")
"""Codecs that give rows back as they were, whichever other rows there are."""


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
    if before is not None and _is_same(decode_array(before.payload, before.spec), array):
        return before
    codec = "bits" if before is None and array.dtype == bool else _codec_of(before)
    if codec in _EXACT_HERE:
        try:
            coded = encode_array(array, codec)
        except CodingError:
            coded = None
        if coded is not None and _is_same(decode_array(coded.payload, coded.spec), array):
            return coded
    return encode_array(array, "exact")


def _codec_of(coded: CodedArray | None) -> Any:
    return None if coded is None else coded.spec.get("codec")


def _is_same(one: np.ndarray, other: np.ndarray) -> bool:
    return one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes()
