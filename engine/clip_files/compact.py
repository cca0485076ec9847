"""The compact form of a finished clip: what is stored, shown and measured, and what other clips are trained against.

Made once, when the training of a clip ends. Values are rounded to what the stored form holds, each within a stated
error; entries of the field's tables that no anchor ever reads are left out. Source clips are many and take few bits a
value. A reference clip is one, and others inherit from it: its anchors and heads keep 16 bits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from msgspec.structs import replace as with_entries

from engine.clip_files.array_names import DECODER, FIELD, LOG_DRIFT, MOVING_DECODER, own_kind, table_index
from engine.clip_files.clip_header import SCHEMA, ClipFigures
from engine.clip_files.clip_state import ClipState, write_coded_arrays
from engine.clip_files.coding import CodedArray, CodingError, decode_array, encode_array
from engine.errors import NonFiniteLoss, ProjectError

_BITS = {
    "features": 7,
    "color_logits": 7,
    "log_offset_scales": 6,
    "log_base_scales": 6,
    "velocities": 8,
    "accelerations": 7,
}
"""Bits per value of what a source clip's own anchors hold."""
_TABLE_BITS = 7
_LIGHT_BITS = 8
_POSITION_BITS = 16
"""Of positions on no lattice, per axis of their bounding box: 0.2 mm in a hall of 20 m."""
_MAX_POSITION_ERROR = 0.01
"""Largest error of such a position, spacings of the static anchors, and cells of the field where it is read there;
where the box is too large they stay exact."""

Codec = tuple[str, dict[str, Any]]


@dataclass(frozen=True, slots=True)
class CompactClip:
    """A clip as it is stored. A value.

    Attributes:
        state: The decoded stored form; its header has the fingerprint of these arrays.
        coded: The stored form of every array.
    """

    state: ClipState
    coded: dict[str, CodedArray]

    @property
    def n_bytes(self) -> int:
        """The size of all arrays as stored."""
        return sum(len(array.payload) for array in self.coded.values())

    def with_figures(self, figures: ClipFigures) -> CompactClip:
        """The same clip with its measured figures."""
        return replace(self, state=ClipState(self.state.arrays, with_entries(self.state.header, metrics=figures)))


def compact_clip(
    state: ClipState, entries_in_use: list[np.ndarray] | None = None, *, is_exact: bool = False
) -> CompactClip:
    """Round a finished clip to what is stored.

    Args:
        state: As trained.
        entries_in_use: Entries of each table of the field that some anchor reads at some time, see
            ClipModel.entries_in_use; the others become zero and are not stored. None keeps all. [L, T] bool each
        is_exact: Keep every value as it is.
    Raises:
        NonFiniteLoss: An array holds numbers that are not finite; names it.
        ProjectError: A decoded array differs from the original by more than its codec states.
    """
    coded, decoded = {}, {}
    for name, array in state.arrays.items():
        _check_finite(name, array)
        table = table_index(name)
        if entries_in_use is not None and table is not None:
            array = np.where(entries_in_use[table][..., None], array, np.float32(0))
        coded[name] = _encode(array, [("exact", {})] if is_exact else _codecs(name, array, state))
        decoded[name] = decode_array(coded[name].payload, coded[name].spec)
        _check_error(name, array, decoded[name], coded[name])
    return CompactClip(ClipState(decoded, with_entries(state.header, schema=SCHEMA)).stamped(), coded)


def write_compact_clip(path: Path | str, clip: CompactClip) -> None:
    """Write atomically; `read_clip_state` gives `clip.state` back.

    Raises:
        ProjectError: The disk refused.
    """
    write_coded_arrays(path, clip.coded, clip.state.header)


def _codecs(name: str, array: np.ndarray, state: ClipState) -> list[Codec]:
    """Codecs for an array, best first; the last one holds anything."""
    kind = own_kind(name)
    exact: Codec = ("exact", {})
    if array.dtype == bool:
        return [("bits", {}), exact]
    if array.dtype != np.float32:
        return [exact]
    if table_index(name) is not None:
        return [("steps", {"bits": _TABLE_BITS}), exact]
    if kind == "positions":
        is_in_field = name.replace("positions", "presence") in state.arrays
        return [*_position_codecs(array, state, is_in_field=is_in_field), exact]
    if kind in _BITS and not state.is_reference:
        return [("steps", {"bits": _BITS[kind]}), exact]
    if name.endswith(".light"):
        return [("steps", {"bits": _LIGHT_BITS}), exact]
    if name == LOG_DRIFT:
        return [("half", {}), exact]
    if kind is not None or name.startswith((DECODER, MOVING_DECODER, FIELD)):
        return [("half", {}), exact]
    return [exact]


def _position_codecs(array: np.ndarray, state: ClipState, *, is_in_field: bool) -> list[Codec]:
    """Hulls lie on a grid of voxels; other positions get steps where those are small against the anchors' spacing, and
    against the finest cells of the field, which would be read elsewhere than it has learned."""
    codecs: list[Codec] = []
    if state.header.moving_spacing:
        codecs.append(("lattice", {"spacing": state.header.moving_spacing}))
    side = float(np.ptp(array, axis=0).max()) if len(array) else 0.0
    smallest, field = state.header.spacing, state.header.field
    if is_in_field and field is not None:
        smallest = min(smallest, field.side * min(field.aspect) / max(field.cells))
    if side / 2 ** (_POSITION_BITS + 1) < _MAX_POSITION_ERROR * smallest:
        codecs.append(("steps", {"bits": _POSITION_BITS}))
    return codecs


def _encode(array: np.ndarray, codecs: list[Codec]) -> CodedArray:
    for codec, options in codecs[:-1]:
        try:
            return encode_array(array, codec, **options)
        except CodingError:
            continue
    codec, options = codecs[-1]
    return encode_array(array, codec, **options)


def _check_finite(name: str, array: np.ndarray) -> None:
    if not np.issubdtype(array.dtype, np.floating):
        return
    n_bad = int((~np.isfinite(array)).sum())
    if n_bad:
        raise NonFiniteLoss(
            f"{n_bad} of {array.size} numbers in {name} of the trained clip are not finite; it was not saved.",
            hint="Train it again with another seed or smaller learning rates.",
        )


def _check_error(name: str, array: np.ndarray, decoded: np.ndarray, coded: CodedArray) -> None:
    is_alike = decoded.shape == array.shape and decoded.dtype == array.dtype
    errors = np.zeros(1)
    if is_alike and array.dtype.kind == "f":
        errors = np.abs(decoded.astype(np.float64) - array)
        is_alike = bool((errors <= coded.bounds).all())
    elif is_alike:
        is_alike = bool((decoded == array).all())
    if not is_alike:
        raise ProjectError(
            f"The stored form of {name} is up to {errors.max(initial=0.0):.3g} off what was trained, "
            f"{coded.spec['max_error']:.3g} was promised; the clip was not saved.",
            hint="This is a bug in the program; the checkpoint is kept.",
        )
