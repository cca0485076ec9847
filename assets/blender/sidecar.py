# SPDX-License-Identifier: MIT
"""Reads NAME_export.json: which files a sequence has, its timing, up direction, scale and cameras. No bpy here."""

import json
import math
from bisect import bisect_right
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .problem import SequenceProblem

SUFFIX = "_export.json"
SCHEMA = 1
PARTS = ("all", "static", "moving")
_MAX_BYTES = 1 << 26
_MAX_FRAME = 1 << 24
_MAX_FPS = 10_000.0
_MAX_PX = 1 << 16
_EXPORT = "Export again with `clipgstream export PROJECT --format ply --out DIR`."


@dataclass(frozen=True)
class SequenceCamera:
    """A camera of the capture, without lens distortion.

    Attributes:
        size: Width and height, pixels.
        K: Intrinsics, pixels, pixel centres at +0.5. 3 rows of 3
        camera_to_world: In the coordinates of the files; x right, y down, z forward. 3 rows of 4
    """

    name: str
    size: tuple[int, int]
    K: list[list[float]]
    camera_to_world: list[list[float]]


@dataclass(frozen=True)
class Sequence:
    """An exported sequence.

    Attributes:
        first_frame, last_frame: What it covers, numbered as its files are.
        fps: Frames per second at which it was captured.
        up: Which way is up in the files. [3]
        meters_per_unit: Of the files; None where the project does not say.
        files: By part the first frame of each file, rising, and its path.
        near_plane: Nearest depth that is drawn, in units of the files; None in exports of earlier versions.
        cameras: May be none, in exports of earlier versions.
    """

    name: str
    path: Path
    first_frame: int
    last_frame: int
    fps: float
    up: tuple[float, float, float]
    meters_per_unit: float | None
    files: dict[str, tuple[list[int], list[Path]]]
    near_plane: float | None
    cameras: list[SequenceCamera]

    def file_at(self, part: str, frame: float) -> Path:
        """The file of a part that holds at a frame, the first one before that."""
        starts, paths = self.files[part]
        return paths[max(bisect_right(starts, frame) - 1, 0)]


def read_sequence(path: Path) -> Sequence:
    """Read a sidecar. Raises SequenceProblem where it is missing, damaged, newer, or not of PLY files."""
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise ValueError(f"it is larger than {_MAX_BYTES >> 20} MB")
        document = json.loads(path.read_bytes())
        schema = document["schema"]
        if type(schema) is not int or "files" not in document:
            raise ValueError("it has no list of files")
        if schema > SCHEMA:
            cause = f"It was written by a newer version of ClipGStream Studio: schema {schema}, known here is {SCHEMA}."
            raise SequenceProblem(cause, "Install the add-on of that version: `clipgstream blender`.", path)
        return _sequence(document, path)
    except OSError as error:
        cause = f"The description of the sequence cannot be read: {error.strerror}."
        raise SequenceProblem(cause, "Relink it if it was moved.", path) from error
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        said = f"{error} is missing" if isinstance(error, KeyError) else str(error)[:200]
        cause = f"This is not the description of an exported sequence: {said}."
        raise SequenceProblem(cause, f"Choose the file NAME{SUFFIX}.", path) from error


def _sequence(document: dict[str, Any], path: Path) -> Sequence:
    files: dict[str, tuple[list[int], list[Path]]] = {}
    for row in sorted(document["files"], key=lambda row: _whole(row["frame"], 0, _MAX_FRAME)):
        name, part = row["file"], row["part"]
        if part not in PARTS:
            raise ValueError(f"its part {str(part)[:40]!r} is not known")
        if not name.endswith(".ply") or name.endswith(".compressed.ply"):
            raise SequenceProblem(f"Its files are not plain PLY files: {name[:80]}.", _EXPORT, path)
        if Path(name).name != name or {"\\", "\0"} & set(name):
            raise ValueError("a file lies outside its folder")
        starts, paths = files.setdefault(part, ([], []))
        starts.append(row["frame"])
        paths.append(path.parent / name)
    if not files:
        raise SequenceProblem("The sequence has no files.", _EXPORT, path)
    first = _whole(document["first_frame"], 0, _MAX_FRAME)
    meters = document.get("meters_per_unit")
    x, y, z = _numbers(document["up"], 3)
    if x * x + y * y + z * z < 1e-12:
        raise ValueError("its up direction has no length")
    return Sequence(
        name=path.name.removesuffix(SUFFIX),
        path=path,
        first_frame=first,
        last_frame=_whole(document["last_frame"], first, _MAX_FRAME),
        fps=_positive(document["fps"], _MAX_FPS),
        up=(x, y, z),
        meters_per_unit=None if meters is None else _positive(meters, 1e9),
        files=files,
        near_plane=_positive(document["near_plane"], 1e9) if "near_plane" in document else None,
        cameras=[_camera(row) for row in document.get("cameras", ())],
    )


def _camera(row: dict[str, Any]) -> SequenceCamera:
    width, height = (_whole(side, 1, _MAX_PX) for side in row["image_size"])
    K = [_numbers(line, 3) for line in row["K"]]
    pose = [_numbers(line, 4) for line in row["camera_to_world"]]
    if len(K) != 3 or len(pose) != 3:
        raise ValueError("a camera is not complete")
    _positive(K[0][0], 1e9)
    _positive(K[1][1], 1e9)
    return SequenceCamera(str(row["name"])[:200], (width, height), K, pose)


def _whole(value: Any, low: int, high: int) -> int:
    if type(value) is not int or not low <= value <= high:
        raise ValueError(f"{str(value)[:40]} is not a whole number from {low} to {high}")
    return value


def _positive(value: Any, high: float) -> float:
    (number,) = _numbers([value], 1)
    if not 0.0 < number <= high:
        raise ValueError(f"{number} is not a number above 0")
    return number


def _numbers(values: Any, n: int) -> list[float]:
    found = [float(value) for value in values if type(value) in (int, float)]
    if len(found) != n or len(values) != n or not all(map(math.isfinite, found)):
        raise ValueError(f"{n} numbers were expected")
    return found
