"""Point clouds that come with captures, read strictly: COLMAP's points, PLY files, arrays of points and colours."""

from __future__ import annotations

import os
import struct
import zipfile
import zlib
from array import array
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

import numpy as np

from engine.capture.colmap.model_files import BinaryReader, damaged, lines_of, unreadable
from engine.capture.files.places import place_in
from engine.capture.layout.format_result import Layout
from engine.capture.layout.limits import MAX_POSITION
from engine.capture.ply import as_bytes, check_n_points, read_ply
from engine.errors import CaptureError
from engine.storage.files import open_regular
from engine.storage.npy_files import NpyError, parse_npy

MAX_NPZ_BYTES = 2 << 30
MAX_NPZ_RATIO = 20
"""How much larger than its file an array may become."""
_BIN_RECORD = struct.Struct("<Q3d3BdQ")


@dataclass(frozen=True, eq=False)
class CapturePoints:
    """A point cloud. A value.

    Attributes:
        points: [P, 3] float32 or float64, in the world of the file.
        colors: Display colours, None where the file has none. [P, 3] uint8
        n_dropped: Points of the file that are left out: NaN, infinite, or farther away than anything may be.
    """

    points: np.ndarray
    colors: np.ndarray | None
    n_dropped: int = 0


def points_that_came(folder: Path, names: Sequence[str], *, follow_links: bool) -> Path | None:
    """The first of these files that is there, relative to the capture's folder, and may be read; None without."""
    for name in names:
        path = folder / name
        if not path.is_file():
            continue
        try:
            return place_in(folder, name, follow_links=follow_links, named_in=folder)
        except CaptureError:  # a link that leads out of the capture: as if it were not there
            continue
    return None


def points_of(layout: Layout) -> CapturePoints | None:
    """The cloud that came with a capture, in the world of its cameras; None where none came.

    Raises:
        CaptureError: As of `read_points`.
    """
    if layout.points is None:
        return None
    cloud = read_points(layout.points)
    matrix = layout.points_to_world
    return cloud if matrix is None else replace(cloud, points=cloud.points @ matrix[:3, :3].T + matrix[:3, 3])


def read_points(path: Path) -> CapturePoints:
    """Points of points3D.bin, points3D.txt, a .ply or a .npz with an array "data" [P, 3 or more].

    Raises:
        CaptureError: The file is missing, of another kind, damaged or too large.
    """
    readers = {".bin": _read_binary, ".txt": _read_text, ".ply": read_ply, ".npz": _read_npz}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise CaptureError(
            "The file is not a supported point cloud.", hint="Give a .ply, or COLMAP's points3D.bin.", path=path
        )
    try:
        with open_regular(path) as file:
            points, colors = reader(file, path)
    except OSError as error:
        raise unreadable(path, error) from error
    is_good = np.ones(len(points), bool)
    with np.errstate(invalid="ignore"):
        for column in points.T:
            is_good &= np.abs(column) <= MAX_POSITION
    n_dropped = int(len(points) - is_good.sum())
    if n_dropped:
        points, colors = points[is_good], None if colors is None else colors[is_good]
    return CapturePoints(points, colors, n_dropped)


def _read_binary(file: BinaryIO, path: Path) -> tuple[np.ndarray, np.ndarray]:
    reader = BinaryReader(file, path)
    n_points = reader.count(_BIN_RECORD.size, "points")
    check_n_points(n_points, path)
    points, colors = np.empty((n_points, 3)), np.empty((n_points, 3), np.uint8)
    for row in range(n_points):
        _, *values, _, n_track = reader.record(_BIN_RECORD.format)
        points[row], colors[row] = values[:3], values[3:]
        reader.skip(8 * n_track)
    reader.end()
    return points, colors


def _read_text(file: BinaryIO, path: Path) -> tuple[np.ndarray, np.ndarray]:
    values, colors = array("d"), bytearray()
    for line in lines_of(file, path):
        words = line.split(None, 7)
        if not words:
            continue
        row = len(values) // 3
        check_n_points(row + 1, path)
        try:
            position = [float(word) for word in words[1:4]]
            color = [min(max(int(word), 0), 255) for word in words[4:7]]
        except ValueError as error:
            raise damaged(path, f"point number {row} has values that are not numbers") from error
        if len(color) != 3:
            raise damaged(path, f"point number {row} has no position and colour")
        values.extend(position)
        colors.extend(color)
    points = np.frombuffer(values, np.float64) if values else np.zeros(0)
    return points.reshape(-1, 3), np.frombuffer(colors, np.uint8).reshape(-1, 3)


def _read_npz(file: BinaryIO, path: Path) -> tuple[np.ndarray, np.ndarray | None]:
    """init_pt_cld.npz of Dynamic 3D Gaussians: x y z, red green blue 0..1, a label."""
    n_bytes = os.fstat(file.fileno()).st_size
    try:
        with zipfile.ZipFile(file) as archive:
            member = archive.getinfo("data.npy")
            if member.file_size > min(MAX_NPZ_BYTES, max(1 << 20, MAX_NPZ_RATIO * n_bytes)):
                raise damaged(path, f"its array would take {member.file_size:,} bytes")
            with archive.open(member) as content:
                data = content.read(member.file_size + 1)
        values = parse_npy(data)
    except KeyError as error:
        hint = "Name the array data: one row per point, x y z red green blue."
        raise CaptureError("The file has no array called data.", hint=hint, path=path) from error
    except NpyError as error:
        raise damaged(path, str(error)) from error
    except (OSError, zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, ValueError) as error:
        raise damaged(path, "it is not an archive of arrays") from error
    if values.ndim != 2 or values.shape[1] < 3:
        raise damaged(path, f"its array has shape {values.shape}, not points by coordinates")
    check_n_points(len(values), path)
    colors = None
    if values.shape[1] >= 6:
        colors = values[:, 3:6]
        is_share = len(colors) == 0 or not np.nanmax(colors, initial=0.0) > 1.0
        colors = as_bytes(colors * 255.0 if is_share else colors)
    return values[:, :3].astype(np.float64), colors


def said_of(points: CapturePoints, path: Path) -> Iterable[str]:
    """Warnings about a cloud that was read."""
    if points.n_dropped:
        yield f"{points.n_dropped:,} points of {path.name} are not finite numbers and are left out."
