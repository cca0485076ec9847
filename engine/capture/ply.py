"""Points and colours of PLY files: text or little-endian binary, whatever else their points have."""

from __future__ import annotations

import os
from pathlib import Path
from typing import BinaryIO

import numpy as np

from engine.capture.colmap.model_files import damaged
from engine.errors import CaptureError
from engine.text import shown

MAX_POINTS = 20_000_000
"""Points of a cloud that are read."""
MAX_HEADER_BYTES = 1 << 16
MAX_PROPERTIES = 1000
MAX_LINE_BYTES = 1 << 16
_TYPES = {
    **{"char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "<i2", "int16": "<i2", "ushort": "<u2"},
    **{"uint16": "<u2", "int": "<i4", "int32": "<i4", "uint": "<u4", "uint32": "<u4"},
    **{"float": "<f4", "float32": "<f4", "double": "<f8", "float64": "<f8"},
}
_COLORS = (("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green", "diffuse_blue"))
_TO_BYTES = {
    **{"u1": 1.0, "i1": 1.0, "<u2": 255.0 / 65535.0, "<i2": 1.0, "<i4": 1.0, "<u4": 1.0, "<f4": 255.0, "<f8": 255.0}
}
"""The factor of a colour, by the type that it has in the file."""
_BLOCK_POINTS = 1 << 12


def check_n_points(n: int, path: Path) -> None:
    """Raise CaptureError where a cloud is larger than is read."""
    if n > MAX_POINTS:
        text = f"The cloud has {n:,} points, at most {MAX_POINTS:,} are read."
        raise CaptureError(text, hint="Thin it out.", path=path)


def read_ply(file: BinaryIO, path: Path) -> tuple[np.ndarray, np.ndarray | None]:
    """Points [P, 3], float32 or float64 as the file has them, and colours [P, 3] uint8, or None where it has none.

    Args:
        file: Open for reading, at its beginning.
        path: For messages.
    Raises:
        CaptureError: Not a PLY file that is read, damaged, or too large.
    """
    form, n_points, fields = _header(file, path)
    names = [name for name, _ in fields]
    if not {"x", "y", "z"} <= set(names):
        raise CaptureError("The points have no x, y and z.", hint="Export the cloud again.", path=path)
    colors_of = next((three for three in _COLORS if set(three) <= set(names)), None)
    columns = [names.index(name) for name in ("x", "y", "z", *(colors_of or ()))]
    left = os.fstat(file.fileno()).st_size - file.tell()
    least = np.dtype(fields).itemsize if form == "binary_little_endian" else 2 * len(fields) - 1
    if n_points * least > left:
        raise damaged(path, f"it announces {n_points} points, but only {left} bytes follow")
    types = dict(fields)
    points = np.empty((n_points, 3), np.float32 if types["x"] == "<f4" else np.float64)
    colors = None if colors_of is None else np.empty((n_points, 3), np.uint8)
    for start in range(0, n_points, _BLOCK_POINTS):
        n = min(_BLOCK_POINTS, n_points - start)
        block = _binary(file, path, n, fields, columns) if form != "ascii" else _text(file, path, n, fields, columns)
        with np.errstate(over="ignore"):
            points[start : start + n] = block[:, :3]
        if colors is not None and colors_of is not None:
            colors[start : start + n] = as_bytes(block[:, 3:] * _TO_BYTES[types[colors_of[0]]])
    return points, colors


def as_bytes(colors: np.ndarray) -> np.ndarray:
    """Colours 0..255 of any numbers, rounded; what is not a number becomes 0. [P, 3] uint8"""
    return np.floor(np.clip(np.nan_to_num(colors), 0.0, 255.0) + 0.5).astype(np.uint8)


def _header(file: BinaryIO, path: Path) -> tuple[str, int, list[tuple[str, str]]]:
    """Format, number of points and the fields of each."""
    if file.read(4).rstrip() != b"ply":
        raise damaged(path, "it is not a PLY file")
    form, n_points, fields, element, has_ended = "", None, [], "", False
    while not has_ended and file.tell() < MAX_HEADER_BYTES:
        line = file.readline(MAX_LINE_BYTES)
        words = line.decode("ascii", "replace").split()
        match words:
            case []:
                if not line:
                    break
            case ["format", form, *_]:
                pass
            case ["element", "vertex", number] if not element and number.isascii() and number.isdigit():
                element, n_points = "vertex", int(number[:20])
            case ["element", name, *_]:
                if n_points is None:
                    text = f"Its first elements are {shown(name)}, not points."
                    raise CaptureError(text, hint="Export the cloud with its points first.", path=path)
                element = name
            case ["property", kind, name] if element == "vertex" and kind in _TYPES:
                fields.append((name, _TYPES[kind]))
            case ["property", *_] if element == "vertex":
                raise damaged(path, f"a point has the property {shown(' '.join(words[1:]))}")
            case ["end_header"]:
                has_ended = True
            case _:
                pass  # comments, faces
    if not has_ended or n_points is None:
        raise damaged(path, "its header is not complete")
    if form not in ("ascii", "binary_little_endian"):
        hint = "Export it as text or as binary little endian."
        raise CaptureError(f"The format {shown(form)} of the PLY file is not supported.", hint=hint, path=path)
    if len({name for name, _ in fields}) != len(fields) or not 0 < len(fields) <= MAX_PROPERTIES:
        raise damaged(path, "its points have no properties, too many, or one twice")
    check_n_points(n_points, path)
    return form, n_points, fields


def _binary(file: BinaryIO, path: Path, n: int, fields: list[tuple[str, str]], columns: list[int]) -> np.ndarray:
    kind = np.dtype(fields)
    data = file.read(n * kind.itemsize)
    if len(data) != n * kind.itemsize:
        raise damaged(path, "it ends too early")
    rows = np.frombuffer(data, kind, n)
    with np.errstate(invalid="ignore"):
        return np.stack([rows[fields[column][0]].astype(np.float64) for column in columns], axis=1)


def _text(file: BinaryIO, path: Path, n: int, fields: list[tuple[str, str]], columns: list[int]) -> np.ndarray:
    values = np.empty((n, len(columns)))
    for row in range(n):
        words = file.readline(MAX_LINE_BYTES).split()
        if len(words) != len(fields):
            raise damaged(path, f"a point has {len(words)} values instead of {len(fields)}")
        try:
            values[row] = [float(words[column]) for column in columns]
        except ValueError as error:
            raise damaged(path, "a point has values that are not numbers") from error
    return values
