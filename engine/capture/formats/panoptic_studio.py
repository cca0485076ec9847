"""CMU Panoptic Studio as it is downloaded: calibration_<sequence>.json and the HD videos hdVideos/hd_00_<camera>.mp4.

Each camera has `name` ("00_03"), `type`, `resolution`, `K`, `distCoef` (5), `R` and `t` in centimetres, world to
camera; pixel centres at whole numbers. Only HD cameras are used, as VGA and Kinect ones record at other times; the
world is brought to metres. HD cameras whose video was not downloaded are left out.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from engine.capture.cameras.described_camera import DescribedCamera
from engine.capture.cameras.opencv_numbers import lens_of, pose_of, shifted
from engine.capture.files.frame_files import Files, listed, natural_key
from engine.capture.files.frame_search import FrameSearch
from engine.capture.layout.assembling import assemble
from engine.capture.layout.findings import Findings
from engine.capture.layout.format_checks import (
    is_name,
    parse_matrix,
    parse_size,
    read_json_object,
    shortened,
    size_problem,
)
from engine.capture.layout.format_result import MATCH, Layout, Probe
from engine.errors import CaptureError
from engine.text import shown

FORMAT = "panoptic-studio"
LAYOUT = "calibration_<sequence>.json with hdVideos/ (CMU Panoptic Studio as downloaded)"
"""The layout in words."""
FRAME_FOLDERS = ("hdVideos", "hdImgs")
METRES = 0.01
"""Length of its unit, the centimetre."""
HINT = "Download the calibration again."


def probe(folder: Path) -> Probe:
    """Whether the folder looks like this layout."""
    has_videos = any((folder / name).is_dir() for name in FRAME_FOLDERS)
    paths = _calibrations(folder)
    if paths and has_videos:
        return MATCH
    if paths:
        hint = "Download the HD videos into hdVideos/ (getData.sh of the Panoptic Toolbox)."
        return Probe(False, seen=paths[0].name, lacks="no hdVideos/ or hdImgs/", hint=hint)
    if has_videos:
        return Probe(False, seen="hdVideos/", lacks="no calibration_<sequence>.json", hint="Put it next to the folder.")
    return Probe(False, lacks="no calibration_<sequence>.json")


def read(folder: Path, *, follow_links: bool = False) -> Layout:
    """Read cameras and the headers of their frames; no pixels.

    Args:
        follow_links: Whether frames may lie outside of the folder.
    Raises:
        CaptureError: Listing every problem found.
    """
    path = _calibrations(folder)[0]
    rows = read_json_object(path).get("cameras")
    if not isinstance(rows, list):
        raise CaptureError("The file lists no cameras.", hint=HINT, path=path)
    findings = Findings()
    search = FrameSearch(folder, FRAME_FOLDERS, follow_links=follow_links, named_in=path)
    cameras: list[DescribedCamera] = []
    absent: list[str] = []
    for index, row in enumerate(rows):
        if not isinstance(row, dict) or not isinstance(row.get("name"), str):
            findings.add(CaptureError(f"Camera number {index} has no name.", hint=HINT, path=path))
        elif row.get("type") == "hd":
            called = row["name"] if is_name(row["name"]) else shown(row["name"])
            found = findings.tried(lambda row=row: [search.find([f"hd_{row['name']}", row["name"]])], camera=called)
            if found == [None]:
                absent.append(called)
            files = found[0] if found else None
            if files is None:
                continue
            camera = _described(row, called, files, path, findings)
            if camera is not None:
                cameras.append(camera)
    if not cameras and not findings.problems:
        text = f"None of the {len(absent)} HD cameras has a video in hdVideos/."
        findings.add(CaptureError(text, hint="Their names are hd_00_00.mp4 and so on.", path=path))
    cameras.sort(key=lambda camera: natural_key(camera.name))
    said = [f"HD cameras without a video are left out: {shortened(absent)}."] if absent else []
    return assemble(folder, FORMAT, cameras, problems=findings.problems, warnings=said, said_in=path)


def _calibrations(folder: Path) -> list[Path]:
    try:
        names = listed(folder, (".json",))
    except OSError:
        return []
    return [folder / name for name in names if name.startswith("calibration_") and (folder / name).is_file()]


def _described(
    row: dict[str, Any], called: str, files: Files, path: Path, findings: Findings
) -> DescribedCamera | None:
    """One camera; None where something is wrong with it, which is kept."""
    K = findings.tried(lambda: _numbers(row, "K", (3, 3), path), camera=called)
    size = findings.tried(lambda: _size(row, path), camera=called)
    lens = findings.tried(
        lambda: lens_of(_numbers(row, "distCoef", (5,), path), is_fisheye=False, path=path), camera=called
    )
    pose = findings.tried(lambda: _pose(row, path), camera=called)
    if K is None or size is None or lens is None or pose is None:
        return None
    return DescribedCamera(row["name"], shifted(K), pose, files, path, calibrated_size=size, lens=lens)


def _numbers(row: dict[str, Any], key: str, shape: tuple[int, ...], path: Path) -> np.ndarray:
    values = parse_matrix(row.get(key), shape)
    if values is None:
        raise CaptureError(f"It has no {key} of {'x'.join(map(str, shape))} numbers.", hint=HINT, path=path)
    return values


def _size(row: dict[str, Any], path: Path) -> tuple[int, int]:
    sides = row.get("resolution")
    sides = sides if isinstance(sides, list) and len(sides) == 2 else [None, None]
    size = parse_size(sides[0], sides[1])
    if size is None:
        raise size_problem("Its resolution is", sides[0], sides[1], path)
    return size


def _pose(row: dict[str, Any], path: Path) -> np.ndarray:
    rotation = _numbers(row, "R", (3, 3), path)
    translation = parse_matrix(row.get("t"), (3, 1))
    translation = _numbers(row, "t", (3,), path) if translation is None else translation
    return pose_of(rotation, METRES * translation)
