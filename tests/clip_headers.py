"""Headers of clip files for tests: complete ones of which a test says only what it is about, and damaged ones."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import to_builtins

from engine.clip_files.clip_header import SCHEMA, ClipHeader
from engine.clip_files.clip_state import ClipState
from engine.storage.array_files import write_arrays
from engine.storage.typed_json import to_type

DECODER = {"static_dim": 2, "dynamic_dim": 2, "gaussians_per_anchor": 1, "hidden": 4}


def header_values(**entries: Any) -> dict[str, Any]:
    """Header of a finished reference clip, as JSON; entries replace or add."""
    return {
        "schema": SCHEMA,
        "role": "reference",
        "clip_index": 0,
        "clip_length": 1,
        "n_frames": 1,
        "start": 0,
        "step": 6,
        "n_steps": 6,
        "seed": 0,
        "config": {},
        "camera_names": [],
        "near_plane": 0.1,
        "spacing": 0.1,
        "decoder": DECODER,
        "field": None,
        "fingerprint": "clip",
        **entries,
    }


def make_header(**entries: Any) -> ClipHeader:
    """Likewise, as it is read."""
    return to_type(header_values(**entries), ClipHeader)


def changed(header: ClipHeader, **entries: Any) -> ClipHeader:
    """A header with other entries, given as JSON has them."""
    return to_type(to_builtins(header, builtin_types=()) | entries, ClipHeader)


def with_header(state: ClipState, **entries: Any) -> ClipState:
    """A state with other entries in its header."""
    return ClipState(state.arrays, changed(state.header, **entries))


def write_values(path: Path, arrays: dict[str, np.ndarray], values: dict[str, Any]) -> None:
    """A clip file with a header of any kind."""
    write_arrays(path, arrays, {"header": json.dumps(values)}, what="The clip")
