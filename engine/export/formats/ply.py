"""The .ply of 3D Gaussian Splatting: 14 floats per Gaussian, which nearly every program reads, or all 62 of the
reference code for programs that want a row of 248 bytes."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from engine.export.formats.damaged import damaged
from engine.export.splats import Splats, colors_of, opacities_of

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
    """Read a file of `write` or `write_full`. Raises ProjectError where it is something else."""
    elements = read_header(file)
    names = tuple(elements.get("vertex", (0, ()))[1])
    if names not in (COLUMNS, FULL_COLUMNS):
        raise damaged("its columns differ")
    rows = read_rows(file, elements["vertex"][0], len(names), "<f4")
    rows = rows[:, [names.index(name) for name in COLUMNS]]
    return Splats(
        means=rows[:, 0:3],
        quats=rows[:, 10:14],
        scales=np.exp(rows[:, 7:10].astype(np.float64)).astype(np.float32),
        opacities=opacities_of(rows[:, 6]),
        colors=colors_of(rows[:, 3:6]),
    )


def header(elements: dict[str, tuple[int, str, tuple[str, ...]]]) -> bytes:
    """The head of a binary PLY file: by element its number of rows, the type of its columns and their names."""
    lines = ["ply", "format binary_little_endian 1.0", "comment Written by ClipGStream Studio"]
    for name, (n_rows, kind, columns) in elements.items():
        lines += [f"element {name} {n_rows}", *(f"property {kind} {column}" for column in columns)]
    return "\n".join([*lines, "end_header", ""]).encode("ascii")


def read_header(file: BinaryIO) -> dict[str, tuple[int, list[str]]]:
    """Elements in their order, each with its number of rows and its columns."""
    if file.readline(16) != b"ply\n":
        raise damaged("it is not a PLY file")
    elements: dict[str, tuple[int, list[str]]] = {}
    while file.tell() < _MAX_HEADER_BYTES:
        match file.readline(_MAX_HEADER_BYTES).decode("ascii", "replace").split():
            case ["element", name, number] if number.isdecimal():
                elements[name] = int(number), []
            case ["property", _, name] if elements:
                list(elements.values())[-1][1].append(name)
            case ["end_header"]:
                return elements
            case ["format" | "comment", *_]:
                pass
            case _:
                break
    raise damaged("its head is not complete")


def read_rows(file: BinaryIO, n_rows: int, n_columns: int, kind: str) -> np.ndarray:
    """Rows of columns of one type. [n_rows, n_columns]"""
    n_bytes = n_rows * n_columns * np.dtype(kind).itemsize
    data = file.read(n_bytes)
    if len(data) != n_bytes:
        raise damaged("it ends too early")
    return np.frombuffer(data, kind).reshape(n_rows, n_columns)
