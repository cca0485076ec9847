"""Technicolor light fields: cameras_parameters.txt and <scene>_undist_<frame>_<camera>.png.

After a line of headings the file has a row per camera, in the order of their numbers: f cu cv ar sk, a quaternion
qw qx qy qz and tx ty tz, world to camera. Frame numbers do not begin with 0. Pixel centres are at +0.5.
"""

from __future__ import annotations

import math
import re
from collections import defaultdict
from pathlib import Path

import numpy as np

from engine.capture.cameras.described_camera import DescribedCamera
from engine.capture.files.frame_files import IMAGE_SUFFIXES, images_in, listed
from engine.capture.growing.mode import is_growing
from engine.capture.layout.assembling import assemble
from engine.capture.layout.findings import Findings
from engine.capture.layout.format_checks import check_equal_counts, shortened
from engine.capture.layout.format_result import MATCH, Layout, Probe
from engine.errors import CaptureError
from engine.storage.files import read_bytes

FORMAT = "technicolor"
LAYOUT = "cameras_parameters.txt and <scene>_undist_<frame>_<camera>.png (Technicolor)"
"""The layout in words."""
FILE = "cameras_parameters.txt"
FRAME = re.compile(r"(?P<scene>.*)_(?P<frame>[0-9]{1,9})_(?P<camera>[0-9]{1,9})\.[^.]+", re.ASCII)
N_COLUMNS = 12
MAX_BYTES = 1 << 20
HINT = "Download the undistorted pictures with their cameras_parameters.txt again."


def probe(folder: Path) -> Probe:
    """Whether the folder looks like this layout."""
    if not (folder / FILE).is_file():
        return Probe(False, lacks=f"no {FILE}")
    if _pictures(folder):
        return MATCH
    hint = "Put the pictures <scene>_undist_<frame>_<camera>.png next to it."
    return Probe(False, seen=FILE, lacks="no pictures named by frame and camera", hint=hint)


def read(folder: Path, *, follow_links: bool = False) -> Layout:
    """Read cameras and the headers of their frames; no pixels.

    Args:
        follow_links: Whether pictures may lie outside of the folder.
    Raises:
        CaptureError: Listing every problem found.
    """
    path = folder / FILE
    findings = Findings()
    rows = _rows(path)
    by_camera = _pictures(folder)
    present = sorted(by_camera)
    unknown = [f"{camera:02d}" for camera in present if camera >= len(rows)]
    if unknown:
        text = f"The file has {len(rows)} cameras, but there are also pictures of {shortened(unknown)}."
        findings.add(CaptureError(text, hint=HINT, path=path))
    absent = [f"{camera:02d}" for camera in range(len(rows)) if camera not in by_camera]
    times = sorted({frame for frames in by_camera.values() for frame in frames})
    counts = {f"{camera:02d}": len(by_camera[camera]) for camera in present}
    findings.problems += check_equal_counts(counts, dict.fromkeys(counts, folder))
    cameras: list[DescribedCamera] = []
    for camera in present:
        name = f"{camera:02d}"
        own = by_camera[camera]
        if camera >= len(rows):
            continue
        if not findings.problems and sorted(own) != times and not is_growing():
            missing = sorted(set(times) - set(own))
            text = f"It has no picture of frame {missing[0]}."
            findings.add(CaptureError(text, hint="Put all pictures back.", path=folder), camera=name)
        names = [own[frame] for frame in sorted(own)]
        files = findings.tried(
            lambda names=names: images_in(folder, "", names, follow_links=follow_links, named_in=path), camera=name
        )
        described = findings.tried(lambda camera=camera: _camera_numbers(rows[camera], path), camera=name)
        if files is not None and described is not None:
            cameras.append(DescribedCamera(name, described[0], described[1], files, path))
    said = [f"Cameras without pictures are left out: {shortened(absent)}."] if absent else []
    return assemble(folder, FORMAT, cameras, problems=findings.problems, warnings=said, said_in=path)


def _pictures(folder: Path) -> dict[int, dict[int, str]]:
    """Names of pictures by camera and frame number."""
    found: dict[int, dict[int, str]] = defaultdict(dict)
    try:
        names = listed(folder, IMAGE_SUFFIXES)
    except OSError:
        return {}
    for name in names:
        match = FRAME.fullmatch(name)
        if match is not None:
            found[int(match["camera"])][int(match["frame"])] = name
    return dict(found)


def _rows(path: Path) -> list[list[float]]:
    try:
        text = read_bytes(path, max_bytes=MAX_BYTES).decode("utf-8-sig")
    except OSError as error:
        said = f"The file cannot be read ({error.strerror})."
        raise CaptureError(said, hint="Check that you may read it.", path=path) from error
    except UnicodeDecodeError as error:
        raise CaptureError(f"Byte {error.start} is not UTF-8.", hint=HINT, path=path) from error
    rows: list[list[float]] = []
    for line, words in enumerate((row.split() for row in text.splitlines()[1:]), start=2):
        if not words:
            continue
        if len(words) != N_COLUMNS:
            kind = " These are of distorted pictures." if len(words) == N_COLUMNS + 2 else ""
            said = f"Line {line} has {len(words)} numbers, not {N_COLUMNS}.{kind}"
            raise CaptureError(said, hint=HINT, path=path)
        try:
            rows.append([float(word) for word in words])
        except ValueError as error:
            raise CaptureError(f"Line {line} does not hold only numbers.", hint=HINT, path=path) from error
    return rows


def _camera_numbers(row: list[float], path: Path) -> tuple[np.ndarray, np.ndarray]:
    """K and world-to-camera map of a row."""
    focal, cx, cy, aspect, skew, *rest = row
    K = np.array([[focal, skew, cx], [0.0, focal * aspect, cy], [0.0, 0.0, 1.0]])
    w, x, y, z = rest[:4]
    length = math.sqrt(w * w + x * x + y * y + z * z) if all(abs(value) < 1e6 for value in rest[:4]) else math.nan
    if not abs(length - 1.0) < 1e-2:  # NaN too
        text = f"Its quaternion has the length {length:.3g}, not 1."
        raise CaptureError(text, hint=HINT, path=path)
    w, x, y, z = w / length, x / length, y / length, z / length
    pose = np.eye(4)
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    pose[:3, 3] = rest[4:]
    return K, pose
