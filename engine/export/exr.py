"""OpenEXR: scan lines, ZIP compression, one part, any channels of half or single precision. Written, not read.

Layout: https://openexr.com/en/latest/OpenEXRFileLayout.html. A file is a header of named attributes, a table with the
place of every block, and blocks of 16 lines each. Within a line, channels follow each other in order of their names.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

_MAGIC = b"\x76\x2f\x31\x01\x02\x00\x00\x00"
"""Magic number, and version 2 without flags: one part of scan lines, short names."""
_LINES_PER_BLOCK = 16
_ZIP = 3
_PIXEL_TYPES = {np.dtype(np.float16): 1, np.dtype(np.float32): 2}
_MAX_NAME = 31
_REC_709 = (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)
"""x and y of red, green, blue and white: primaries of sRGB and HD video."""


def write_exr(path: Path, channels: Mapping[str, np.ndarray], *, comments: Mapping[str, str] | None = None) -> None:
    """Write one picture.

    By convention R, G and B are linear and multiplied with A, Z is the distance from the camera's plane.

    Args:
        channels: By name, float16 or float32, all of one size. [H, W] each
        comments: More attributes of the header, as text.
    Raises:
        ValueError: No channels, or channels of other types or of several sizes.
        OSError: The disk refused.
    """
    if not channels:
        raise ValueError("an OpenEXR file needs at least one channel")
    names = sorted(channels)
    planes = [_checked(name, channels[name], channels[names[0]].shape) for name in names]
    height, width = planes[0].shape
    blocks = [_block(planes, first) for first in range(0, height, _LINES_PER_BLOCK)]
    header = _header(names, planes, width, height, comments or {})
    places = len(header) + 8 * len(blocks) + np.cumsum([0, *map(len, blocks[:-1])])
    with path.open("wb") as file:
        file.write(header)
        file.write(places.astype("<u8").tobytes())
        file.writelines(blocks)


def _checked(name: str, plane: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    if plane.dtype not in _PIXEL_TYPES or plane.ndim != 2 or plane.shape != shape or plane.size == 0:
        raise ValueError(f"channel {name} must be float16 or float32 of size {shape}, is {plane.dtype} {plane.shape}")
    if not 0 < len(name.encode()) <= _MAX_NAME:
        raise ValueError(f"{name!r} cannot be the name of a channel")
    return plane.astype(plane.dtype.newbyteorder("<"), copy=False)


def _block(planes: list[np.ndarray], first: int) -> bytes:
    """Up to 16 lines: first line, number of bytes, bytes."""
    height = planes[0].shape[0]
    lines = range(first, min(first + _LINES_PER_BLOCK, height))
    raw = b"".join(plane[y].tobytes() for y in lines for plane in planes)
    packed = zlib.compress(_rearranged(raw), 4)
    data = packed if len(packed) < len(raw) else raw  # readers infer from the size which of the two it is
    return struct.pack("<ii", first, len(data)) + data


def _rearranged(raw: bytes) -> bytes:
    """Bytes at even places before those at odd ones, then differences from the byte before: this packs well."""
    flat = np.frombuffer(raw, np.uint8)
    halves = np.concatenate([flat[0::2], flat[1::2]]).astype(np.int16)
    halves[1:] = halves[1:] - halves[:-1] + 128
    return halves.astype(np.uint8).tobytes()


def _header(names: list[str], planes: list[np.ndarray], width: int, height: int, comments: Mapping[str, str]) -> bytes:
    channel_list = b"".join(
        name.encode() + b"\0" + struct.pack("<iB3xii", _PIXEL_TYPES[plane.dtype.newbyteorder("=")], 0, 1, 1)
        for name, plane in zip(names, planes, strict=True)
    )
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    attributes = [
        ("channels", "chlist", channel_list + b"\0"),
        ("chromaticities", "chromaticities", struct.pack("<8f", *_REC_709)),
        ("compression", "compression", bytes([_ZIP])),
        ("dataWindow", "box2i", window),
        ("displayWindow", "box2i", window),
        ("lineOrder", "lineOrder", b"\0"),
        ("pixelAspectRatio", "float", struct.pack("<f", 1.0)),
        ("screenWindowCenter", "v2f", struct.pack("<2f", 0.0, 0.0)),
        ("screenWindowWidth", "float", struct.pack("<f", 1.0)),
        *((name, "string", text.encode()) for name, text in comments.items()),
    ]
    written = b"".join(
        name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value
        for name, kind, value in attributes
    )
    return _MAGIC + written + b"\0"
