"""The .ply of 3D Gaussian Splatting: 14 floats per Gaussian, which nearly every program reads, or all 62 of the
reference code for programs that want a row of 248 bytes."""

from __future__ import annotations

from os import SEEK_END
from typing import BinaryIO, NamedTuple

import numpy as np

from engine.export.formats.damaged import damaged
from engine.export.splats import Splats, colors_of, opacities_of
from engine.text import shown

COLUMNS = (
    *("x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity"),
    *("scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"),
)
FULL_COLUMNS = (
    *("x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"),
    *(f"f_rest_{index}" for index in range(45)),
    *("opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"),
)
"""As the reference code of 3D Gaussian Splatting writes them."""
_MAX_HEADER_BYTES = 1 << 16
_MAX_DIGITS = 19
_KINDS = {
    **{name: "i1" for name in ("char", "int8")},
    **{name: "u1" for name in ("uchar", "uint8")},
    **{name: "<i2" for name in ("short", "int16")},
    **{name: "<u2" for name in ("ushort", "uint16")},
    **{name: "<i4" for name in ("int", "int32")},
    **{name: "<u4" for name in ("uint", "uint32")},
    **{name: "<f4" for name in ("float", "float32")},
    **{name: "<f8" for name in ("double", "float64")},
}
"""Types of columns as files name them."""
_ROWS = 1 << 16
"""Full rows made at a time."""


def write(splats: Splats, file: BinaryIO) -> tuple[str, ...]:
    """Centres, colours of degree 0, logits of opacities, logarithms of scales, rotations wxyz."""
    file.write(header({"vertex": (len(splats), "float", COLUMNS)}))
    file.write(_rows(splats).tobytes())
    return ()


def write_full(splats: Splats, file: BinaryIO) -> tuple[str, ...]:
    """Likewise in the columns of the reference code: normals and colours of higher degrees are 0, as the scene has
    none of either."""
    file.write(header({"vertex": (len(splats), "float", FULL_COLUMNS)}))
    wide = np.zeros((min(len(splats), _ROWS), len(FULL_COLUMNS)), "<f4")
    rows = _rows(splats)
    places = [FULL_COLUMNS.index(name) for name in COLUMNS]
    for start in range(0, len(rows), _ROWS):
        part = rows[start : start + _ROWS]
        wide[: len(part), places] = part
        file.write(wide[: len(part)].tobytes())
    return ()


def _rows(splats: Splats) -> np.ndarray:
    """The values of COLUMNS. [N, 14]"""
    rows = np.empty((len(splats), len(COLUMNS)), "<f4")
    rows[:, 0:3] = splats.means
    rows[:, 3:6] = splats.f_dc
    rows[:, 6] = splats.opacity_logits
    rows[:, 7:10] = np.log(splats.scales.astype(np.float64))
    rows[:, 10:14] = splats.quats
    return rows


def read(file: BinaryIO) -> Splats:
    """Read a file of `write` or `write_full`, or one of another program: columns in any order, and others beside them.
    Colours of higher degrees are left out. Raises ProjectError where it is something else."""
    elements = read_header(file)
    vertex = elements.get("vertex", PlyElement(0, {}))
    missing = [name for name in COLUMNS if name not in vertex.columns]
    if missing:
        raise damaged(f"it has no column {missing[0]}")
    if next(iter(elements)) != "vertex":
        raise damaged("its Gaussians do not come first")
    rows = read_rows(file, vertex)
    rest = [name for name in vertex.columns if name.startswith("f_rest_")]

    def columns(*names: str) -> np.ndarray:
        return np.stack([rows[name] for name in names], axis=1).astype(np.float32, copy=False)

    return Splats(
        means=columns(*COLUMNS[0:3]),
        quats=columns(*COLUMNS[10:14]),
        scales=np.exp(columns(*COLUMNS[7:10]).astype(np.float64)).astype(np.float32),
        opacities=opacities_of(rows["opacity"]),
        colors=colors_of(columns(*COLUMNS[3:6])),
        sh_degree=round((len(rest) / 3 + 1) ** 0.5) - 1 if any(rows[name].any() for name in rest) else 0,
    )


def header(elements: dict[str, tuple[int, str, tuple[str, ...]]]) -> bytes:
    """The head of a binary PLY file: by element its number of rows, the type of its columns and their names."""
    lines = ["ply", "format binary_little_endian 1.0", "comment Written by ClipGStream Studio"]
    for name, (n_rows, kind, columns) in elements.items():
        lines += [f"element {name} {n_rows}", *(f"property {kind} {column}" for column in columns)]
    return "\n".join([*lines, "end_header", ""]).encode("ascii")


class PlyElement(NamedTuple):
    """An element in the head of a file: its number of rows, and the types of its columns by name."""

    n_rows: int
    columns: dict[str, str]


def read_header(file: BinaryIO) -> dict[str, PlyElement]:
    """Elements in their order. Raises ProjectError where it is not the head of a binary PLY file."""
    if file.readline(16).rstrip() != b"ply":
        raise damaged("it is not a PLY file")
    elements: dict[str, PlyElement] = {}
    last = PlyElement(0, {})
    while file.tell() < _MAX_HEADER_BYTES:
        match file.readline(_MAX_HEADER_BYTES).decode("ascii", "replace").split():
            case ["element", name, number] if number.isdecimal() and len(number) < _MAX_DIGITS and name not in elements:
                elements[name] = last = PlyElement(int(number), {})
            case ["property", kind, name] if elements and kind in _KINDS and name not in last.columns:
                last.columns[name] = _KINDS[kind]
            case ["format", kind, *_] if kind != "binary_little_endian":
                raise damaged(f"its format is {shown(kind)}, and only binary_little_endian is read")
            case ["end_header"]:
                return elements
            case ["format" | "comment" | "obj_info", *_]:
                pass
            case _:
                break
    raise damaged("its head is not complete")


def read_rows(file: BinaryIO, element: PlyElement) -> np.ndarray:
    """The rows of an element, which come next. [n_rows] with a field for each column"""
    kind = np.dtype(list(element.columns.items()))
    n_bytes, at = element.n_rows * kind.itemsize, file.tell()
    n_left = file.seek(0, SEEK_END) - at  # a head may announce what no memory holds
    file.seek(at)
    if n_bytes > n_left:
        raise damaged("it ends too early")
    return np.frombuffer(file.read(n_bytes), kind)
