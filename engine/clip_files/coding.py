"""Arrays as few bytes: each of four codecs gives a payload, what is needed to read it, and how far off it may be.

exact     the array's own bytes
half      float32 as float16
steps     float32 as whole steps of a size of its own per channel; rows of a table that are zero take one bit
lattice   float32 positions as whole steps of one spacing, the same on every axis, exact to float rounding
bits      bool as one bit a value

What a codec leaves goes through LZMA, whose adaptive literals come close to the entropy of the steps. A payload says
nothing about itself: shape, size and checksum lie in the specification, a dict for a JSON header.
"""

from __future__ import annotations

import lzma
import math
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

MAX_BYTES = 1 << 29
"""No array of a clip takes more once it is unpacked; a specification that says so is damaged."""
_FILTERS = [{"id": lzma.FILTER_LZMA2, "preset": 6, "dict_size": 1 << 20, "lc": 0, "lp": 0, "pb": 0}]
_FLOAT_MAX = float(np.finfo(np.float32).max)
_HALF_MAX = float(np.finfo(np.float16).max)
_KINDS = ("?", "u1", "i1", "<u2", "<i2", "<u4", "<i4", "<u8", "<i8", "<f2", "<f4", "<f8")
_DTYPES = {np.dtype(kind).str: np.dtype(kind) for kind in _KINDS}
"""By the names that a specification gives them."""


class CodingError(ValueError):
    """A payload and its specification do not fit together, or an array does not suit a codec."""


@dataclass(frozen=True, slots=True)
class CodedArray:
    """An array as it is stored. A value.

    Attributes:
        payload: Compressed bytes. [n] uint8
        spec: codec, dtype, shape, n_bytes (before compression), crc32 (likewise), max_error (largest difference to
            the original, in the array's own unit) and what the codec adds.
        bounds: Largest difference to the original of each value; has the array's shape or broadcasts to it.
    """

    payload: np.ndarray
    spec: dict[str, Any]
    bounds: np.ndarray


Packed = tuple[bytes, dict[str, Any], np.ndarray]
"""Bytes before compression, what the codec adds to the specification, and the bounds of the error."""


def encode_array(array: np.ndarray, codec: str, **options: Any) -> CodedArray:
    """Pack an array.

    Args:
        array: Finite values.
        codec: See the module docstring.
        options: bits=2..16 for `steps` (default 8), spacing for `lattice`, scene units.
    Raises:
        CodingError: The codec cannot hold this array.
    """
    if np.issubdtype(array.dtype, np.floating) and not np.isfinite(array).all():
        raise CodingError("it holds numbers that are not finite")
    little = np.ascontiguousarray(array.astype(array.dtype.newbyteorder("<"), copy=False)).reshape(array.shape)
    if little.dtype.str not in _DTYPES:
        raise CodingError(f"arrays of {array.dtype} cannot be stored")
    return _coded(little, codec, *_CODECS[codec][0](little, **options))


def encode_on_grid_of(array: np.ndarray, other: CodedArray) -> CodedArray:
    """Pack an array whose values lie where those of a coded array may lie, such as some of its rows, exactly.

    Args:
        other: Of `steps` with two axes, or of `lattice`; sound.
    Raises:
        CodingError: They do not lie there, or the other array has no grid.
    """
    codec, spec = other.spec["codec"], other.spec
    if codec not in _ON_GRID or len(spec["shape"]) != 2 or array.shape[1:] != tuple(spec["shape"][1:]):
        raise CodingError(f"{codec} has no grid for an array of shape {array.shape}")
    before = lzma.decompress(other.payload.tobytes(), format=lzma.FORMAT_RAW, filters=_FILTERS)
    raw = _ON_GRID[codec](array, before, spec)
    coded = _coded(array, codec, raw, {key: spec[key] for key in ("bits",) if key in spec}, np.zeros(1))
    if decode_array(coded.payload, coded.spec).tobytes() != array.tobytes():
        raise CodingError(f"values are off the grid of {codec}")
    return CodedArray(coded.payload, coded.spec | {"max_error": spec["max_error"]}, other.bounds)


def _coded(array: np.ndarray, codec: str, raw: bytes, extra: dict[str, Any], bounds: np.ndarray) -> CodedArray:
    spec = {
        "codec": codec,
        "dtype": array.dtype.str,
        "shape": list(array.shape),
        "n_bytes": len(raw),
        "crc32": zlib.crc32(raw),
        "max_error": float(bounds.max(initial=0.0)),
    }
    payload = np.frombuffer(lzma.compress(raw, format=lzma.FORMAT_RAW, filters=_FILTERS), np.uint8)
    return CodedArray(payload, spec | extra, bounds)


def decode_array(payload: np.ndarray, spec: dict[str, Any]) -> np.ndarray:
    """Unpack what `encode_array` made.

    Raises:
        CodingError: The payload is damaged or another one than the specification says. Nothing larger than the
            specification's sizes, and no more than MAX_BYTES, is ever allocated.
    """
    try:
        dtype, shape = _DTYPES[spec["dtype"]], tuple(int(n) for n in spec["shape"])
        n_bytes, unpack = int(spec["n_bytes"]), _CODECS[spec["codec"]][1]
        n_values = math.prod(shape)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise CodingError(f"the description is incomplete ({error})") from error
    if min((*shape, n_bytes)) < 0 or max(n_values * dtype.itemsize, n_bytes) > MAX_BYTES:
        raise CodingError(f"shape {shape} of {dtype} in {n_bytes} bytes is not an array of a clip")
    try:
        unpacker = lzma.LZMADecompressor(format=lzma.FORMAT_RAW, filters=_FILTERS)
        raw = unpacker.decompress(np.ascontiguousarray(payload, np.uint8).tobytes(), max_length=n_bytes + 1)
    except lzma.LZMAError as error:
        raise CodingError(f"the bytes cannot be unpacked ({error})") from error
    is_whole = unpacker.eof and not unpacker.unused_data and len(raw) == n_bytes
    if not is_whole or zlib.crc32(raw) != spec.get("crc32"):
        raise CodingError(f"{len(raw)} of {n_bytes} bytes are present, or they were changed")
    try:
        array = unpack(raw, dtype, shape, spec)
    except (KeyError, TypeError, ValueError, IndexError, OverflowError, MemoryError) as error:
        raise CodingError(f"the bytes do not fit shape {shape} ({error})") from error
    if (array.shape, array.dtype) != (shape, dtype):
        raise CodingError(f"{spec['codec']} gives {array.dtype} {array.shape}, not {dtype} {shape}")
    return array


# ---------------------------------------------------------------- exact, half, bits


def _pack_exact(array: np.ndarray) -> Packed:
    return _planes(array), {}, np.zeros(1)


def _unpack_exact(raw: bytes, dtype: np.dtype, shape: tuple[int, ...], spec: dict[str, Any]) -> np.ndarray:
    return _from_planes(raw, dtype).reshape(shape)


def _pack_half(array: np.ndarray) -> Packed:
    _need_float(array)
    largest = float(np.abs(array).max(initial=0.0))
    if largest > _HALF_MAX:
        raise CodingError(f"a value of {largest:.4g} is too large for 16 bits")
    # half the distance of neighbours: 11 bits of mantissa, and 2^-24 between the smallest
    return _planes(array.astype("<f2")), {}, np.abs(array).astype(np.float64) * 2.0**-11 + 2.0**-25


def _unpack_half(raw: bytes, dtype: np.dtype, shape: tuple[int, ...], spec: dict[str, Any]) -> np.ndarray:
    return _from_planes(raw, np.dtype("<f2")).astype(np.float32).reshape(shape)


def _pack_bits(array: np.ndarray) -> Packed:
    if array.dtype != bool:
        raise CodingError(f"{array.dtype} is not bool")
    return np.packbits(_channels_first(array)).tobytes(), {}, np.zeros(1)


def _unpack_bits(raw: bytes, dtype: np.dtype, shape: tuple[int, ...], spec: dict[str, Any]) -> np.ndarray:
    n = math.prod(shape)
    if len(raw) != (n + 7) // 8:
        raise CodingError(f"{len(raw)} bytes do not hold {n} bits")
    values = np.unpackbits(np.frombuffer(raw, np.uint8), count=n).astype(bool)
    return _rows_first(values, shape)


# ---------------------------------------------------------------- steps


def _pack_steps(array: np.ndarray, *, bits: int = 8) -> Packed:
    """Groups of channels [G, n, C]: a table's levels, or all rows as one group. Zero is a whole number of steps."""
    _need_float(array)
    groups = _grouped(array)
    n_groups, n_rows, n_channels = groups.shape
    is_table = array.ndim == 3
    is_kept = (groups != 0).any(-1) if is_table else np.ones((n_groups, n_rows), bool)
    sizes = np.zeros((n_groups, n_channels, 2))  # step and lowest step of each channel
    codes = []
    for group, kept, size in zip(groups, is_kept, sizes, strict=True):
        values = group[kept].astype(np.float64)  # [n, C]
        if len(values) == 0:
            continue
        low, high = values.min(0), values.max(0)
        # a constant channel is one step away from zero, which is exact
        step = np.where(high > low, (high - low) / (2**bits - 2), np.where(low == 0, 1.0, np.abs(low)))
        first = np.round(low / step)
        size[:] = np.stack([step, first], axis=1)
        codes.append(_planes(np.ascontiguousarray((np.round(values / step) - first).T.astype(_code_dtype(bits)))))
    # half a step, and the rounding of the sum to float32
    reach = np.abs(groups).max(1, initial=0.0).astype(np.float64)  # [G, C]
    bounds = 0.5 * sizes[:, :, 0] * (1 + 1e-9) + reach * 2.0**-24 + 2.0**-149
    mask = np.packbits(is_kept).tobytes() if is_table else b""
    raw = sizes.astype("<f8").tobytes() + mask + b"".join(codes)
    bounds = bounds[:, None, :] if is_table else bounds[0]
    return raw, {"bits": bits}, np.broadcast_to(bounds, array.shape) if array.size else np.zeros(1)


def _unpack_steps(raw: bytes, dtype: np.dtype, shape: tuple[int, ...], spec: dict[str, Any]) -> np.ndarray:
    if dtype != np.float32:
        raise CodingError(f"{dtype} has no steps")
    n_groups, n_rows, n_channels = _group_shape(shape)
    code_dtype = _code_dtype(int(spec["bits"]))
    n_least = (n_groups * n_rows + 7) // 8 if len(shape) == 3 else n_rows * n_channels * code_dtype.itemsize
    if len(raw) < 16 * n_groups * n_channels + n_least:  # seen before memory for the values is taken
        raise CodingError(f"{len(raw)} bytes are too few")
    groups = np.zeros((n_groups, n_rows, n_channels), np.float32)
    at = 16 * n_groups * n_channels
    sizes = np.frombuffer(raw[:at], "<f8").reshape(n_groups, n_channels, 2)
    is_kept = np.ones((n_groups, n_rows), bool)
    if len(shape) == 3:
        n_mask = (n_groups * n_rows + 7) // 8
        bits = np.unpackbits(np.frombuffer(raw[at : at + n_mask], np.uint8), count=n_groups * n_rows)
        is_kept, at = bits.reshape(n_groups, n_rows).astype(bool), at + n_mask
    for group, kept, size in zip(groups, is_kept, sizes, strict=True):
        n = int(kept.sum())
        n_bytes = n * n_channels * code_dtype.itemsize
        codes = _from_planes(raw[at : at + n_bytes], code_dtype).reshape(n_channels, n)
        at += n_bytes
        values = (codes + size[:, 1:]) * size[:, :1]  # [C, n] float64
        group[kept] = np.clip(values, -_FLOAT_MAX, _FLOAT_MAX).T
    if at != len(raw):
        raise CodingError(f"{len(raw)} bytes instead of {at}")
    return groups.reshape(shape)


def _code_dtype(bits: int) -> np.dtype:
    if not 2 <= bits <= 16:
        raise CodingError(f"steps of {bits} bits are not known")
    return np.dtype("u1") if bits <= 8 else np.dtype("<u2")


def _group_shape(shape: tuple[int, ...]) -> tuple[int, int, int]:
    if len(shape) == 3:
        return (shape[0], shape[1], shape[2])
    if len(shape) != 2:
        raise CodingError(f"shape {shape} has no rows and channels")
    return (1, shape[0], shape[1])


def _grouped(array: np.ndarray) -> np.ndarray:
    return array.reshape(_group_shape(array.shape))


def _steps_on_grid(array: np.ndarray, before: bytes, spec: dict[str, Any]) -> bytes:
    n_channels, code_dtype = array.shape[1], _code_dtype(int(spec["bits"]))
    sizes = np.frombuffer(before[: 16 * n_channels], "<f8").reshape(n_channels, 2)
    codes = np.round(array.astype(np.float64) / np.where(sizes[:, 0] == 0, 1.0, sizes[:, 0])) - sizes[:, 1]
    if not ((codes >= 0) & (codes <= np.iinfo(code_dtype).max)).all():
        raise CodingError("values lie outside the grid")
    return before[: 16 * n_channels] + _planes(np.ascontiguousarray(codes.T.astype(code_dtype)))


# ---------------------------------------------------------------- lattice


def _pack_lattice(array: np.ndarray, *, spacing: float) -> Packed:
    _need_float(array)
    if array.ndim != 2 or not spacing > 0:
        raise CodingError(f"shape {array.shape} with spacing {spacing} is not a set of positions")
    positions = array.astype(np.float64)
    origin = positions[0] if len(positions) else np.zeros(array.shape[1])
    spacing = _fitted_spacing(positions - origin, spacing)
    steps = np.round((positions - origin) / spacing)
    if np.abs(steps).max(initial=0.0) >= 2**30:
        raise CodingError("the positions are too far apart")
    origin = origin + (positions - (origin + steps * spacing)).mean(0) if len(positions) else origin
    # two float32 roundings: of the original, which lay on the lattice, and of what is read
    bound = np.abs(positions).max(initial=0.0) * 2.0**-22 + 2.0**-148
    off = np.abs(origin + steps * spacing - positions).max(initial=0.0)
    if off > bound:
        raise CodingError(f"positions lie up to {off:.3g} beside a lattice of spacing {spacing:.6g}")
    raw = np.array([*origin, spacing], "<f8").tobytes() + _folded_steps(steps)
    return raw, {}, np.full(1, 1.5 * bound)


def _lattice_on_grid(array: np.ndarray, before: bytes, spec: dict[str, Any]) -> bytes:
    n_axes = array.shape[1]
    numbers = np.frombuffer(before[: 8 * (n_axes + 1)], "<f8")
    steps = np.round((array.astype(np.float64) - numbers[:n_axes]) / numbers[n_axes])
    if not (np.abs(steps) < 2**30).all():
        raise CodingError("the positions are too far apart")
    return numbers.tobytes() + _folded_steps(steps)


def _folded_steps(steps: np.ndarray) -> bytes:
    deltas = np.diff(steps, axis=0, prepend=0.0).astype(np.int64)
    folded = np.where(deltas < 0, -2 * deltas - 1, 2 * deltas).astype("<u4")  # small numbers for both signs
    return _planes(np.ascontiguousarray(folded.T))


def _fitted_spacing(offsets: np.ndarray, spacing: float) -> float:
    """The given spacing is rounded or not quite that of the points: least squares over their steps."""
    steps = np.round(offsets / spacing)
    square = float((steps * steps).sum())
    return float((steps * offsets).sum()) / square if square > 0 else spacing


def _unpack_lattice(raw: bytes, dtype: np.dtype, shape: tuple[int, ...], spec: dict[str, Any]) -> np.ndarray:
    n_rows, n_axes = shape
    at = 8 * (n_axes + 1)
    numbers = np.frombuffer(raw[:at], "<f8")
    folded = _from_planes(raw[at:], np.dtype("<u4")).reshape(n_axes, n_rows).T.astype(np.int64)
    steps = np.where(folded & 1, -(folded + 1) // 2, folded // 2).cumsum(0)
    return (numbers[:n_axes] + steps * numbers[n_axes]).astype(np.float32)


# ---------------------------------------------------------------- bytes


def _planes(array: np.ndarray) -> bytes:
    """First bytes of all values, then their second bytes, and so on: alike bytes side by side pack better."""
    flat = np.ascontiguousarray(array).reshape(-1)
    return flat.view(np.uint8).reshape(len(flat), -1).T.tobytes() if len(flat) else b""


def _from_planes(raw: bytes, dtype: np.dtype) -> np.ndarray:
    if len(raw) % dtype.itemsize:
        raise CodingError(f"{len(raw)} bytes are not a whole number of {dtype}")
    planes = np.frombuffer(raw, np.uint8).reshape(dtype.itemsize, len(raw) // dtype.itemsize)
    return np.ascontiguousarray(planes.T).reshape(-1).view(dtype)


def _channels_first(array: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(array.T) if array.ndim == 2 else array


def _rows_first(values: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    return np.ascontiguousarray(values.reshape(shape[::-1]).T) if len(shape) == 2 else values.reshape(shape)


def _need_float(array: np.ndarray) -> None:
    if array.dtype != np.float32:
        raise CodingError(f"{array.dtype} is not float32")


_CODECS: dict[str, tuple[Callable[..., Packed], Callable[..., np.ndarray]]] = {
    "exact": (_pack_exact, _unpack_exact),
    "half": (_pack_half, _unpack_half),
    "bits": (_pack_bits, _unpack_bits),
    "steps": (_pack_steps, _unpack_steps),
    "lattice": (_pack_lattice, _unpack_lattice),
}
_ON_GRID: dict[str, Callable[[np.ndarray, bytes, dict[str, Any]], bytes]] = {
    "steps": _steps_on_grid,
    "lattice": _lattice_on_grid,
}
