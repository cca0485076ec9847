"""Point clouds as files: PLY, which everything reads, and COLMAP's points without the images that saw them."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from engine.capture.points import CapturePoints

_VERTEX = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("red", "u1"), ("green", "u1"), ("blue", "u1")]
)  # as viewers expect


def write_ply(path: Path, cloud: CapturePoints) -> None:
    """Binary little endian, x y z red green blue. Raises OSError."""
    rows = np.empty(len(cloud.points), _VERTEX)
    for name, column in zip(("x", "y", "z"), cloud.points.T, strict=True):
        rows[name] = column
    for name, column in zip(("red", "green", "blue"), _bytes(cloud).T, strict=True):
        rows[name] = column
    kinds = "".join(f"property {'float' if name in 'xyz' else 'uchar'} {name}\n" for name in _VERTEX.names or ())
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n{kinds}end_header\n"
    path.write_bytes(header.encode("ascii") + rows.tobytes())


def write_colmap_points(folder: Path, cloud: CapturePoints, *, is_binary: bool) -> None:
    """points3D.bin or points3D.txt, each point seen by no image. Raises OSError."""
    colors = _bytes(cloud)
    if is_binary:
        records = [
            struct.pack("<Q3d3BdQ", row + 1, *map(float, point), *map(int, color), 0.0, 0)
            for row, (point, color) in enumerate(zip(cloud.points, colors, strict=True))
        ]
        (folder / "points3D.bin").write_bytes(struct.pack("<Q", len(records)) + b"".join(records))
        return
    lines = ["# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)"]
    lines += [
        f"{row + 1} {x!r} {y!r} {z!r} {red} {green} {blue} 0"
        for row, ((x, y, z), (red, green, blue)) in enumerate(zip(cloud.points.tolist(), colors.tolist(), strict=True))
    ]
    (folder / "points3D.txt").write_text("\n".join(lines) + "\n", encoding="ascii")


def _bytes(cloud: CapturePoints) -> np.ndarray:
    """Colours, grey where there are none. [P, 3] uint8"""
    return np.full((len(cloud.points), 3), 128, np.uint8) if cloud.colors is None else cloud.colors
