"""Fills: what shows in the place of something that an edit takes away.

Two things belong to one: still Gaussians that are a trace of what was taken away, and go with it, and new ones where
the room behind was never seen. The new ones are part of the document, packed: undo restores them to the bit.
"""

from __future__ import annotations

import hashlib
import zlib
from dataclasses import dataclass, fields
from functools import lru_cache

import msgspec
import numpy as np

from engine.editing.edit import Edit

MAX_FILLED = 20_000
"""Gaussians of one fill: it is part of the document, where each takes some 25 bytes."""
FILLED, GUESSED = "filled", "guessed"
"""Roles of the Gaussians of fills, next to those of anchors: seen by some camera, and continued from around."""
_DAMAGED = "the Gaussians of its fill are damaged"
_COUNT = np.dtype("<u4")


@dataclass(frozen=True, slots=True, eq=False)
class FillGaussians:
    """The Gaussians of a fill. See engine.raster.gaussians for their units.

    Attributes:
        means: [N, 3] float32
        quats: [N, 4] float32
        scales: [N, 3] float32
        opacities: [N] float32
        colors: [N, 3] float32
        is_guess: Whether nothing of its place was ever seen. [N] bool
    """

    means: np.ndarray
    quats: np.ndarray
    scales: np.ndarray
    opacities: np.ndarray
    colors: np.ndarray
    is_guess: np.ndarray

    def __len__(self) -> int:
        return len(self.means)

    def __getitem__(self, rows: np.ndarray) -> FillGaussians:
        """The chosen rows, in the given order."""
        return FillGaussians(*(getattr(self, column.name)[rows] for column in fields(self)))


_COLUMNS: dict[str, tuple[str, tuple[int, ...], float]] = {
    "means": ("<f4", (3,), 1.0),
    "quats": ("i1", (4,), 127.0),
    "scales": ("<f4", (3,), 1.0),
    "opacities": ("u1", (), 255.0),
    "colors": ("u1", (3,), 255.0),
    "is_guess": ("u1", (), 1.0),
}
"""Kind, width, and what 1.0 is stored as."""


def fill_key(edit: Edit) -> str:
    """What a fill depends on: the same for edits that take away the same."""
    return hashlib.sha256(_ENCODER.encode((edit.target, edit.action, edit.is_inverted))).hexdigest()[:20]


def fits(edit: Edit) -> bool:
    """Whether an edit has a fill that was made for what it takes away now."""
    return edit.fill is not None and edit.fill.made_for == fill_key(edit)


def packed_fill(found: FillGaussians) -> bytes:
    """Packed for a document, colours and turns rounded to a byte. Raises ValueError for more than MAX_FILLED."""
    if len(found) > MAX_FILLED:
        raise ValueError(f"a fill has {len(found)} Gaussians; the limit is {MAX_FILLED}")
    if not len(found):
        return b""
    parts = [np.array(len(found), _COUNT).tobytes()]
    for name, (kind, _, unit) in _COLUMNS.items():
        values = np.asarray(getattr(found, name), np.float64) * unit
        is_rounded = np.dtype(kind).kind in "iu"
        parts.append((np.rint(values) if is_rounded else values).astype(kind).tobytes())
    return zlib.compress(b"".join(parts), 9)


@lru_cache(maxsize=64)
def unpacked_fill(packed: bytes) -> FillGaussians:
    """Inverse of `packed_fill`; read-only arrays.

    Raises:
        ValueError: These bytes are not from it.
    """
    sizes = {name: np.dtype(kind).itemsize * int(np.prod(width)) for name, (kind, width, _) in _COLUMNS.items()}
    each = sum(sizes.values())
    data = _inflated(packed, _COUNT.itemsize + MAX_FILLED * each) if packed else bytes(_COUNT.itemsize)
    n = int(np.frombuffer(data[: _COUNT.itemsize], _COUNT)[0]) if len(data) >= _COUNT.itemsize else -1
    if n < 0 or len(data) != _COUNT.itemsize + n * each:
        raise ValueError(_DAMAGED)
    columns, place = {}, _COUNT.itemsize
    for name, (kind, width, unit) in _COLUMNS.items():
        raw = np.frombuffer(data, kind, n * int(np.prod(width)), place).reshape(n, *width)
        columns[name] = raw > 0 if name == "is_guess" else raw.astype(np.float32) / np.float32(unit)
        columns[name].flags.writeable = False
        place += n * sizes[name]
    found = FillGaussians(**columns)
    is_sound = np.isfinite(found.means).all() and np.isfinite(found.scales).all() and (found.scales > 0).all()
    if not is_sound or (n and not (found.quats != 0).any(1).all()):
        raise ValueError(_DAMAGED)
    return found


def _inflated(packed: bytes, limit: int) -> bytes:
    unpacker = zlib.decompressobj()
    try:
        data = unpacker.decompress(packed, limit)
    except zlib.error as error:
        raise ValueError(_DAMAGED) from error
    if not unpacker.eof or unpacker.unused_data or unpacker.unconsumed_tail:
        raise ValueError(_DAMAGED)
    return data


_ENCODER = msgspec.msgpack.Encoder()
