"""Google Immersive Light Field Video: models.json and camera_0001.mp4 and so on, all with fisheye lenses.

models.json is a list of cameras: `name`, `width`, `height`, `focal_length`, `principal_point`, `radial_distortion`
(k1 and k2 of the equidistant model; a third one is 0), `orientation` (the rotation vector of world to camera) and
`position` (where the camera stands).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from engine.camera.lens import Lens
from engine.capture.cameras.described_camera import DescribedCamera
from engine.capture.cameras.opencv_numbers import rotation_matrix
from engine.capture.files.frame_files import natural_key
from engine.capture.files.frame_search import FrameSearch
from engine.capture.layout.assembling import assemble
from engine.capture.layout.findings import Findings
from engine.capture.layout.format_checks import is_name, parse_matrix, parse_size, read_json_list, size_problem
from engine.capture.layout.format_result import MATCH, Layout, Probe
from engine.errors import CaptureError
from engine.text import shown

FORMAT = "immersive"
LAYOUT = "models.json and a fisheye video per camera (Google Immersive Light Field Video)"
"""The layout in words."""
FILE = "models.json"
FRAME_FOLDERS = ("", "videos", "images")
HINT = "Download the capture again, or correct the entry."


def probe(folder: Path) -> Probe:
    """Whether the folder looks like this layout."""
    if (folder / FILE).is_file():
        return MATCH
    return Probe(False, lacks=f"no {FILE}")


def read(folder: Path, *, follow_links: bool = False) -> Layout:
    """Read cameras and the headers of their frames; no pixels.

    Args:
        follow_links: Whether frames may lie outside of the folder.
    Raises:
        CaptureError: Listing every problem found.
    """
    path = folder / FILE
    rows = read_json_list(path)
    findings = Findings()
    search = FrameSearch(folder, FRAME_FOLDERS, follow_links=follow_links, named_in=path)
    cameras: list[DescribedCamera] = []
    for index, row in enumerate(rows):
        if not isinstance(row, dict) or not isinstance(row.get("name"), str):
            findings.add(CaptureError(f"Camera number {index} has no name.", hint=HINT, path=path))
            continue
        camera = _described(row, search, path, findings)
        if camera is not None:
            cameras.append(camera)
    cameras.sort(key=lambda camera: natural_key(camera.name))
    return assemble(folder, FORMAT, cameras, problems=findings.problems, said_in=path)


def _described(row: dict[str, Any], search: FrameSearch, path: Path, findings: Findings) -> DescribedCamera | None:
    """One camera; None where something is wrong with it, which is kept."""
    name = row["name"]
    called = name if is_name(name) else shown(name)
    size = findings.tried(lambda: _size(row, path), camera=called)
    K = findings.tried(lambda: _K(row, path), camera=called)
    lens = findings.tried(lambda: _lens(row, path), camera=called)
    pose = findings.tried(lambda: _pose(row, path), camera=called)
    files = findings.tried(lambda: search.files([name]), camera=called)
    if size is None or K is None or lens is None or pose is None or files is None:
        return None
    return DescribedCamera(name, K, pose, files, path, calibrated_size=size, lens=lens)


def _numbers(row: dict[str, Any], key: str, n: int, path: Path) -> np.ndarray:
    values = parse_matrix(row.get(key), (n,))
    if values is None:
        raise CaptureError(f"It has no {key} of {n} numbers.", hint=HINT, path=path)
    return values


def _size(row: dict[str, Any], path: Path) -> tuple[int, int]:
    sides = [row.get("width"), row.get("height")]
    whole = [int(side) if isinstance(side, float) and side.is_integer() else side for side in sides]
    size = parse_size(whole[0], whole[1])
    if size is None:
        raise size_problem("width and height are", sides[0], sides[1], path)
    return size


def _K(row: dict[str, Any], path: Path) -> np.ndarray:
    focal = parse_matrix(row.get("focal_length"), ())
    aspect = parse_matrix(row.get("pixel_aspect_ratio", 1.0), ())
    if focal is None or aspect is None or abs(float(aspect) - 1.0) > 1e-6:
        which = "no focal_length" if focal is None else "pixels that are not square"
        raise CaptureError(f"It has {which}.", hint=HINT, path=path)
    cx, cy = _numbers(row, "principal_point", 2, path)
    return np.array([[float(focal), 0.0, cx], [0.0, float(focal), cy], [0.0, 0.0, 1.0]])


def _lens(row: dict[str, Any], path: Path) -> Lens:
    kind = row.get("projection_type", "fisheye")
    values = row.get("radial_distortion")
    if kind != "fisheye" or not isinstance(values, list) or len(values) < 2:
        which = f"projection_type {shown(kind)}" if kind != "fisheye" else "no radial_distortion of 2 numbers"
        raise CaptureError(f"It has {which}.", hint=HINT, path=path)
    k1, k2 = _numbers({"radial_distortion": values[:2]}, "radial_distortion", 2, path).tolist()
    return Lens("fisheye", (k1, k2))


def _pose(row: dict[str, Any], path: Path) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3] = rotation_matrix(_numbers(row, "orientation", 3, path))
    with np.errstate(over="ignore", invalid="ignore"):  # check_pose tells of absurd numbers
        pose[:3, 3] = -pose[:3, :3] @ _numbers(row, "position", 3, path)
    return pose
