"""Calibrations of Caliscope, anipose, Pose2Sim, FreeMoCap: a TOML file with a table per camera, videos next to it.

Each table has `matrix`, `distortions` (4 or 5), `rotation` (a vector or a matrix) and `translation`, world to camera,
`size` and mostly `name`; pixel centres are at whole numbers. timestamps.csv (cam_id, frame_time), where it is there,
says when each frame was taken. Units are those of the calibration: metres, or sides of the board.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from engine.camera.lens import Lens
from engine.capture.cameras.described_camera import DescribedCamera
from engine.capture.cameras.motion_capture import calibrations
from engine.capture.cameras.opencv_numbers import lens_of, pose_of, shifted
from engine.capture.files.frame_files import Files, listed, natural_key
from engine.capture.files.frame_search import FrameSearch
from engine.capture.files.recording_names import folder_names
from engine.capture.layout.assembling import assemble
from engine.capture.layout.findings import Findings
from engine.capture.layout.format_checks import is_name, parse_matrix, parse_size, shortened, size_problem
from engine.capture.layout.format_result import MATCH, Layout, Probe
from engine.capture.times.frame_times import TIMES_FILE, read_frame_times_table
from engine.errors import CaptureError
from engine.storage.files import read_bytes
from engine.text import shown

FORMAT = "toml"
LAYOUT = "a TOML file with cameras, and a video per camera (Caliscope, anipose, Pose2Sim, FreeMoCap)"
"""The layout in words."""
USUAL = ("camera_array.toml", "camera_array_aniposelib.toml", "calibration.toml")
"""The file's usual names. Among several, the first of these is read."""
PLACES = ("", "calibration")
"""Folders below the capture's where the file may lie."""
FRAME_FOLDERS = ("", "videos", "images", "synchronized_videos")
"""The last is FreeMoCap's."""
QUALISYS = ".qca.txt"
"""The calibration that Pose2Sim projects keep next to the TOML made of it."""
MAX_BYTES = 1 << 20
MAX_DEPTH = 20
"""Of brackets; Python's parser follows them one call deep each."""
MAX_STEPS = 1_000_000
"""Python's parser takes as many for a name as the square of its parts. Dots of numbers are not counted."""
_FLOAT = re.compile(rb"(?<![\w.\-])[+-]?+\d++\.\d++(?:[eE][+-]?\d++)?(?![\w.])")
_NEEDED = ("matrix", "rotation", "translation")


def probe(folder: Path) -> Probe:
    """Whether the folder looks like this layout."""
    broken, empty = [], []
    for path in _candidates(folder):
        try:
            found = dict(_tables(_read_toml(path)))
        except CaptureError as error:
            if path.name in USUAL:
                return MATCH  # reading says what is wrong with it
            broken.append(f"{path.name}, of which {error.message[0].lower()}{error.message[1:].rstrip('.')}")
            continue
        if any(_is_camera(table) for table in found.values()):
            return MATCH
        empty += [path.name] if found or path.name in USUAL else []
    if broken:
        return Probe(False, seen=broken[0], lacks="that cannot be read", hint="Export the calibration again.")
    if empty:
        hint = "Calibrate the cameras' positions too, and export the file again."
        return Probe(False, seen=empty[0], lacks="no camera in it has matrix, rotation and translation", hint=hint)
    return Probe(False, lacks="no .toml with cameras")


def read(folder: Path, *, follow_links: bool = False) -> Layout:
    """Read cameras and the headers of their frames; no pixels.

    Args:
        follow_links: Whether frames may lie outside of the folder.
    Raises:
        CaptureError: Listing every problem found.
    """
    path, tables, warnings = _calibration(folder)
    for other in calibrations(folder, QUALISYS):
        warnings.append(
            f"{other.name} is ignored in favour of {path.name}. If Pose2Sim converted it, its distortions are 64 "
            "times too "
            f"small: take {path.name} away to read the original."
        )
    findings = Findings()
    search = FrameSearch(folder, FRAME_FOLDERS, follow_links=follow_links, named_in=path)
    times: dict[str, np.ndarray] | None = None
    times_path = next((place for sub in FRAME_FOLDERS if (place := folder / sub / TIMES_FILE).is_file()), None)
    if times_path is not None:
        times = findings.tried(lambda: read_frame_times_table(times_path))
    cameras: list[DescribedCamera] = []
    left_out = [key for key, table in tables.items() if table.get("ignore") is True]
    used = {key: table for key, table in tables.items() if key not in left_out}
    likely = {_name(key, table): _likely(key, table) for key, table in used.items()}
    assigned, note = findings.tried(lambda: search.assigned(likely)) or ({}, "")
    warnings += [note] if note else []
    for key, table in sorted(used.items(), key=lambda item: natural_key(_name(*item))):
        camera = _described(key, table, path, search, assigned, times, findings)
        if camera is not None:
            cameras.append(camera)
    if left_out:
        warnings.append(f"Cameras that the calibration ignores are left out: {shortened(left_out)}.")
    warnings += search.left_over()
    return assemble(folder, FORMAT, cameras, problems=findings.problems, warnings=warnings, said_in=path)


def _candidates(folder: Path) -> list[Path]:
    """TOML files that may be the calibration, the likeliest first."""
    found: list[Path] = []
    for place in PLACES:
        inside = folder / place
        try:
            names = listed(inside, (".toml",)) if inside.is_dir() else []
        except OSError:
            continue
        found += [inside / name for name in names]
    order = {name: rank for rank, name in enumerate(USUAL)}
    return sorted((path for path in found if path.is_file()), key=lambda path: order.get(path.name, len(order)))[:50]


def _calibration(folder: Path) -> tuple[Path, dict[str, dict[str, Any]], list[str]]:
    """The file that is read, its camera tables, and what is to be said about others."""
    usable: list[tuple[Path, dict[str, dict[str, Any]]]] = []
    fault: CaptureError | None = None
    for path in _candidates(folder):
        try:
            tables = dict(_tables(_read_toml(path)))
        except CaptureError as error:
            fault = fault or error
            continue
        if any(_is_camera(table) for table in tables.values()):
            usable.append((path, tables))
    if not usable:
        raise fault or CaptureError("No camera in it has matrix, rotation and translation.", path=folder)
    (path, tables), others = usable[0], [other.name for other, _ in usable[1:]]
    said = [f"{path.name} is read; {shortened(others)} would work, too."] if others else []
    if fault is not None:
        said.append(f"{fault.path.name if fault.path else 'Another file'} is left out: {fault.message}")
    return path, tables, said


def _read_toml(path: Path) -> dict[str, Any]:
    hint = "It may be cut off or damaged; export it again."
    try:
        data = read_bytes(path, max_bytes=MAX_BYTES)
    except OSError as error:
        text = f"The file cannot be read ({error.strerror})."
        raise CaptureError(text, hint="Check that you may read it.", path=path) from error
    if max(data.count(b"["), data.count(b"{")) > 200_000 or b"[" * MAX_DEPTH in data.replace(b" ", b""):
        raise CaptureError("The file nests lists too deep.", hint=hint, path=path)
    if sum(row.count(b".") ** 2 for row in _FLOAT.sub(b"", data).split(b"\n")) > MAX_STEPS:
        raise CaptureError("The file has names of too many parts.", hint=hint, path=path)
    try:
        return tomllib.loads(data.decode("utf-8"))
    except UnicodeDecodeError as error:
        text = f"The file is not valid TOML (byte {error.start} is not UTF-8)."
        raise CaptureError(text, hint=hint, path=path) from error
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as error:  # ValueError: a number of 5,000 digits
        raise CaptureError(f"The file is not valid TOML ({error!s:.200}).", hint=hint, path=path) from error


def _tables(document: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Tables of cameras by their section: [cam_0], or [cameras.0] as Caliscope keeps them."""
    nested = document.get("cameras")
    source = nested if isinstance(nested, dict) else document
    for key, table in source.items():
        if isinstance(table, dict) and key != "metadata" and any(name in table for name in _NEEDED):
            yield key, table


def _is_camera(table: dict[str, Any]) -> bool:
    return all(key in table for key in _NEEDED)


def _name(key: str, table: dict[str, Any]) -> str:
    name = table.get("name")
    if isinstance(name, str):
        return name
    return f"cam_{key}" if key.isdigit() else key


def _likely(key: str, table: dict[str, Any]) -> list[str]:
    """Names that the frames of a camera may go by, the likeliest first."""
    name, number = _name(key, table), _number(key, table)
    if "name" in table:
        return [name, *folder_names(name)]
    return [name, key, f"cam_{number}", f"port_{number}"]


def _number(key: str, table: dict[str, Any]) -> str:
    return str(table.get("cam_id", table.get("port", key)))


def _described(
    key: str,
    table: dict[str, Any],
    path: Path,
    search: FrameSearch,
    assigned: Mapping[str, Path],
    times: dict[str, np.ndarray] | None,
    findings: Findings,
) -> DescribedCamera | None:
    """One camera; None where something is wrong with it, which is kept."""
    name = _name(key, table)
    called = name if is_name(name) else shown(name)
    number = _number(key, table)
    own_times = None
    if times is not None:
        own_times = next((times[text] for text in (number, name, number.rpartition("_")[2]) if text in times), None)
        if own_times is None:
            text = f"{TIMES_FILE} has no times of it."
            findings.add(CaptureError(text, hint=f"Add them, or take {TIMES_FILE} away.", path=path), camera=called)
    K = findings.tried(lambda: _numbers(table, "matrix", (3, 3), path), camera=called)
    sizes = findings.tried(lambda: [_size(table, path)], camera=called)
    lens = findings.tried(lambda: _lens(table, path), camera=called)
    pose = findings.tried(lambda: _pose(table, path), camera=called)
    files: Files | None = assigned.get(name)
    if files is None:
        files = findings.tried(lambda: search.files(_likely(key, table)), camera=called)
    if K is None or sizes is None or lens is None or pose is None or files is None:
        return None
    return DescribedCamera(
        name=name,
        K=shifted(K),
        world_to_camera=pose,
        files=files,
        said_in=path,
        calibrated_size=sizes[0],
        lens=lens,
        frame_times_s=own_times,
    )


def _numbers(table: dict[str, Any], key: str, shape: tuple[int, ...], path: Path) -> np.ndarray:
    values = parse_matrix(table.get(key), shape)
    if values is None:
        wanted = "x".join(map(str, shape))
        raise CaptureError(f"It has no {key} of {wanted} numbers.", hint="Export the calibration again.", path=path)
    return values


def _size(table: dict[str, Any], path: Path) -> tuple[int, int] | None:
    size = table.get("size")
    if size is None:
        return None
    sides = size if isinstance(size, list) and len(size) == 2 else [None, None]
    whole = [int(side) if isinstance(side, float) and side.is_integer() else side for side in sides]  # Pose2Sim: 1920.0
    parsed = parse_size(whole[0], whole[1])
    if parsed is None:
        raise size_problem("Its size is", sides[0], sides[1], path)
    return parsed


def _lens(table: dict[str, Any], path: Path) -> Lens:
    found = table.get("distortions", table.get("dist", []))
    values = np.zeros(0) if found == [] else parse_matrix(found, np.shape(found)) if _is_numbers(found) else None
    if values is None:
        raise CaptureError("Its distortions are not numbers.", hint="Export the calibration again.", path=path)
    return lens_of(values, is_fisheye=table.get("fisheye") is True, path=path)


def _is_numbers(found: object) -> bool:
    return isinstance(found, list) and all(isinstance(value, int | float) for value in found)


def _pose(table: dict[str, Any], path: Path) -> np.ndarray:
    rotation = table.get("rotation")
    is_matrix = isinstance(rotation, list) and any(isinstance(row, list) for row in rotation)
    turned = _numbers(table, "rotation", (3, 3) if is_matrix else (3,), path)
    return pose_of(turned, _numbers(table, "translation", (3,), path))
