"""Neural 3D Video and MeetRoom: poses_bounds.npy as of LLFF, and cam00.mp4 and so on, or their extracted frames.

Row i belongs to the i-th video in natural order: 3x5 numbers, of which the first three columns are the camera's axes
down, right and back, the fourth is its place, the fifth height, width and focal length in pixels of the original size;
then the nearest and farthest depth, which are not used. The principal point is the middle of the picture.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from engine.capture.cameras.described_camera import DescribedCamera
from engine.capture.files.frame_files import (
    IMAGE_SUFFIXES,
    INNER_FOLDERS,
    VIDEO_SUFFIXES,
    Files,
    folders_in,
    frames_in_folder,
    listed,
    natural_key,
)
from engine.capture.files.places import place_in
from engine.capture.layout.assembling import assemble
from engine.capture.layout.format_checks import check_equal_counts, parse_size, size_problem
from engine.capture.layout.format_result import MATCH, Layout, Probe
from engine.capture.points import points_that_came
from engine.errors import CaptureError
from engine.storage.npy_files import NpyError, read_npy
from engine.text import shown

FORMAT = "n3dv"
LAYOUT = "N3DV or MeetRoom: poses_bounds.npy and a video or a folder of frames per camera"
"""The layout in words."""
FILE = "poses_bounds.npy"
POINTS = (
    "points3D_downsample2.ply",
    "points3D_downsample.ply",
    "downsampled_points_50.ply",
    "downsampled_points_10.ply",
)
"""Clouds that other programs put next to the poses, in their world."""
MAX_FILE_BYTES = 1 << 24
IMAGES = "images"
"""Of captures of a single moment, as of LLFF: one image per camera."""


def probe(folder: Path) -> Probe:
    """Whether the folder looks like this layout."""
    if not (folder / FILE).is_file():
        return Probe(False, lacks=f"no {FILE}")
    try:
        if any(_candidates(folder).values()):
            return MATCH
    except OSError:
        pass
    hint = "Put the videos cam00.mp4 and so on next to it, in the order of its rows, or folders with their frames."
    return Probe(False, FILE, "no videos or folders of frames next to it", hint)


def read(folder: Path, *, follow_links: bool = False) -> Layout:
    """Read cameras and the headers of their frames; no pixels.

    Args:
        follow_links: Whether files may lie outside of the folder.
    Raises:
        CaptureError: Listing every problem found.
    """
    path = folder / FILE
    rows = _rows(path)
    candidates = _candidates(folder)
    kind = next((kind for kind, names in candidates.items() if len(names) == len(rows)), None)
    if kind is None:
        raise _other_count(len(rows), candidates, path)
    problems: list[CaptureError] = []
    cameras: list[DescribedCamera] = []
    counts: dict[str, int] = {}
    for row, relative in zip(rows, candidates[kind], strict=True):
        name = Path(relative).stem if kind != "folder" else Path(relative).name
        try:
            files = _files(folder, relative, kind, follow_links=follow_links)
            cameras.append(_described(name, row, files, path))
        except CaptureError as error:
            problems.append(error.said_of(f"Camera {shown(name)}"))
            continue
        if isinstance(files, list):
            counts[name] = len(files)
    problems += check_equal_counts(counts, {name: folder for name in counts})
    return assemble(
        folder,
        FORMAT,
        cameras,
        default_holdout=[cameras[0].name] if len(cameras) > 2 else [],
        points=points_that_came(folder, POINTS, follow_links=follow_links),
        problems=problems,
        said_in=path,
    )


def _rows(path: Path) -> np.ndarray:
    """The content of poses_bounds.npy. [C, 17]"""
    hint = "Export the poses again: one row of 17 numbers per camera, as LLFF's imgs2poses writes them."
    try:
        values = read_npy(path, max_bytes=MAX_FILE_BYTES)
    except OSError as error:
        text = f"The file cannot be read ({error.strerror or error})."
        raise CaptureError(text, hint="Check that you may read it.", path=path) from error
    except NpyError as error:
        raise CaptureError(f"The file is not an array of poses ({error}).", hint=hint, path=path) from error
    if values.ndim != 2 or values.shape[1] not in (15, 17) or len(values) == 0:
        shape = " x ".join(map(str, values.shape))
        raise CaptureError(f"The file holds {shape} numbers, not 17 per camera.", hint=hint, path=path)
    return values.astype(np.float64)


def _candidates(folder: Path) -> dict[str, list[str]]:
    """Possible cameras, by kind: videos, folders of frames, single images; relative names in natural order."""
    folders = [name for name in folders_in(folder) if any(sign.isdigit() for sign in name)]
    return {
        "video": listed(folder, VIDEO_SUFFIXES),
        "folder": [name for name in folders if _has_images(folder / name)],
        "image": _in(folder, IMAGES),
    }


def _has_images(folder: Path) -> bool:
    return any(_in(folder, inner) for inner in INNER_FOLDERS)


def _in(folder: Path, inner: str) -> list[str]:
    try:
        names = listed(folder / inner, IMAGE_SUFFIXES)
    except OSError:
        return []
    return [f"{inner}/{name}" if inner else name for name in names]


def _files(folder: Path, relative: str, kind: str, *, follow_links: bool) -> Files:
    if kind == "folder":
        return frames_in_folder(folder, relative, follow_links=follow_links, named_in=folder / FILE)
    path = place_in(folder, relative, follow_links=follow_links, named_in=folder / FILE)
    return path if kind == "video" else [path]


def _described(name: str, row: np.ndarray, files: Files, path: Path) -> DescribedCamera:
    matrix = row[:15].reshape(3, 5)
    height, width, focal = matrix[:, 4]
    is_whole = all(float(side).is_integer() for side in (width, height))
    size = parse_size(int(width), int(height)) if is_whole else None
    if size is None:
        raise size_problem("Its width and height are", float(width), float(height), path)
    world_to_camera = np.eye(4)
    # columns are down, right, back; a camera of OpenCV has right, down, forward
    rotation = np.stack([matrix[:, 1], matrix[:, 0], -matrix[:, 2]])
    world_to_camera[:3, :3] = rotation
    with np.errstate(invalid="ignore", over="ignore"):
        world_to_camera[:3, 3] = -rotation @ matrix[:, 3]
    K = np.array([[focal, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]])
    return DescribedCamera(name, K, world_to_camera, files, path, calibrated_size=size)


def _other_count(n_rows: int, candidates: dict[str, list[str]], path: Path) -> CaptureError:
    """The error where nothing has as many cameras as there are rows: how many there are, and which are missing."""
    words = {"video": "videos", "folder": "folders of frames", "image": "images in images/"}
    there = [f"{len(names)} {words[kind]}" for kind, names in candidates.items() if names]
    fullest = max(candidates.values(), key=len)
    gaps = _gaps(fullest)
    told = f" Between them {', '.join(gaps)} would fit." if gaps and len(fullest) < n_rows else ""
    listed_names = ", ".join(shown(name) for name in fullest[:40])
    hint = "Rows belong to cameras in natural order of their names: put back what is missing, or take out its row."
    if len(fullest) > n_rows:
        hint = "Rows belong to cameras in natural order of their names: take out what has no row."
    text = f"The file has {n_rows} rows, but there are {' and '.join(there)}: {listed_names}.{told}"
    return CaptureError(text, hint=hint, path=path)


def _gaps(names: Sequence[str]) -> list[str]:
    """Names that are left out in a numbering such as cam00, cam01, cam03."""
    keys = [natural_key(name) for name in names]
    if not keys or len({(key[0], key[2:]) for key in keys if len(key) > 2}) != 1 or any(len(key) < 2 for key in keys):
        return []
    numbers = {key[1][1] for key in keys}
    prefix, digits = keys[0][0][2], len(keys[0][1][2])
    missing = [number for number in range(min(numbers), max(numbers)) if number not in numbers]
    return [f"{prefix}{number:0{digits}d}" for number in missing[:10]]
