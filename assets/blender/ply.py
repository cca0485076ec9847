# SPDX-License-Identifier: MIT
"""Reads the .ply of Gaussians into arrays. No bpy here."""

from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from .problem import SequenceProblem

SH_C0 = 0.28209479177387814
"""The value of the spherical harmonic of degree 0: colour = SH_C0 * f_dc + 0.5."""
_COLUMNS = (
    *("x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity"),
    *("scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"),
)
_MAX_HEADER_BYTES = 1 << 16


@dataclass(frozen=True)
class Cloud:
    """Gaussians of one file, in its coordinates.

    Attributes:
        means: Centres. [N, 3] float32
        quats: Rotations wxyz, unit length. [N, 4] float32
        scales: Standard deviations. [N, 3] float32
        opacities: In 0..1. [N] float32
        colors: Display-encoded RGB in 0..1. [N, 3] float32
    """

    means: np.ndarray
    quats: np.ndarray
    scales: np.ndarray
    opacities: np.ndarray
    colors: np.ndarray

    def __len__(self) -> int:
        return len(self.means)

    @property
    def n_bytes(self) -> int:
        """In memory."""
        return 56 * len(self)

    def largest(self, n: int) -> "Cloud":
        """The n that cover most, in their order; all of them where n is 0."""
        if not 0 < n < len(self):
            return self
        sides = np.sort(self.scales, axis=1)
        rows = np.sort(np.argpartition(-self.opacities * sides[:, 1] * sides[:, 2], n)[:n])
        return Cloud(self.means[rows], self.quats[rows], self.scales[rows], self.opacities[rows], self.colors[rows])


def read_cloud(path: Path) -> Cloud:
    """Read a file. Raises SequenceProblem where it is missing, damaged, or something else."""
    try:
        with path.open("rb") as file:
            n_rows, names = _header(file)
            n_bytes = n_rows * 4 * len(names)
            n_there = path.stat().st_size - file.tell()
            if n_there < n_bytes:
                raise ValueError(f"it ends too early, after {max(n_there, 0)} of {n_bytes} bytes")
            rows = np.fromfile(file, "<f4", n_rows * len(names)).reshape(n_rows, len(names))
    except OSError as error:
        cause = f"A file of the sequence cannot be read: {error.strerror}."
        raise SequenceProblem(cause, "Relink the sequence if it was moved.", path) from error
    except ValueError as error:
        raise SequenceProblem(f"A file of the sequence is damaged: {error}.", "Export it again.", path) from error
    if names != list(_COLUMNS):
        rows = rows[:, [names.index(column) for column in _COLUMNS]]
    rows = rows[np.isfinite(rows).all(axis=1)]
    with np.errstate(over="ignore"):
        return Cloud(
            means=rows[:, 0:3].copy(),
            quats=rows[:, 10:14] / np.maximum(np.linalg.norm(rows[:, 10:14], axis=1, keepdims=True), 1e-12),
            scales=np.exp(np.minimum(rows[:, 7:10], 80.0)),
            opacities=1.0 / (1.0 + np.exp(-rows[:, 6])),
            colors=np.clip(rows[:, 3:6] * np.float32(SH_C0) + np.float32(0.5), 0.0, 1.0),
        )


def _header(file: BinaryIO) -> tuple[int, list[str]]:
    """The number of rows and the names of the columns. Raises ValueError."""
    if file.readline(16) != b"ply\n":
        raise ValueError("it is not a PLY file")
    n_rows, names = None, []
    while file.tell() < _MAX_HEADER_BYTES:
        match file.readline(_MAX_HEADER_BYTES).decode("ascii", "replace").split():
            case ["format", "binary_little_endian", "1.0"] | ["comment", *_]:
                pass
            case ["element", "vertex", number] if number.isdecimal() and len(number) < 12 and n_rows is None:
                n_rows = int(number)
            case ["property", "float", name] if n_rows is not None:
                names.append(name)
            case ["end_header"] if n_rows is not None and set(_COLUMNS) <= set(names):
                return n_rows, names
            case _:
                break
    raise ValueError("its head is not that of exported Gaussians")
