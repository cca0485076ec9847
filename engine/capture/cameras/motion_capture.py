"""Shared by the readers of calibrations in XML: where the file lies, numbers in it, cameras without a video."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from engine.capture.cameras.described_camera import DescribedCamera
from engine.capture.files.frame_files import VIDEO_SUFFIXES, Files, listed, natural_key
from engine.capture.files.frame_search import FrameSearch
from engine.capture.layout.assembling import assemble
from engine.capture.layout.findings import Findings
from engine.capture.layout.format_checks import is_name, parse_size, shortened, size_problem
from engine.capture.layout.format_result import MATCH, Layout, Probe
from engine.errors import CaptureError
from engine.storage.xml_files import XmlElement, XmlError, read_xml
from engine.text import shown

PLACES = ("", "calibration")
"""Folders below the capture's where the file may lie; the second is Pose2Sim's."""
FRAME_FOLDERS = ("", "videos", "images")
MAX_TRIED = 20
"""Files of one suffix that are opened to see what they are."""
MM = 0.001
"""Motion capture systems measure in millimetres; this program's distances are then metres."""
_AGAIN = "Export the calibration again."


@dataclass(frozen=True, slots=True)
class NamedCamera:
    """One camera of such a file. names: what its frames may be called, its own first."""

    names: Sequence[str]
    element: XmlElement


def read_motion_capture(
    folder: Path,
    suffix: str,
    format_name: str,
    *,
    cameras_in: Callable[[XmlElement], list[NamedCamera]],
    described: Callable[[str, XmlElement, Files, Path], DescribedCamera],
    follow_links: bool,
    is_it: Callable[[Path], bool] | None = None,
) -> Layout:
    """Read the likeliest calibration of a folder and the headers of its frames; no pixels.

    Args:
        suffix: Of the calibration, with its dot.
        is_it: Whether a file that ends so is one; None where the suffix is enough.
        format_name: Of the layout.
        cameras_in: The cameras of the file that are calibrated.
        described: A camera by its name, its element, its frames and the file.
        follow_links: Whether frames may lie outside of the folder.
    Raises:
        CaptureError: Listing every problem found.
    """
    path, *others = calibrations(folder, suffix, is_it)
    root = read_calibration(path)
    findings = Findings()
    cameras = cameras_in(root)
    if not cameras:
        hint = "Export the calibration again, with its cameras placed and switched on."
        findings.add(CaptureError("No calibrated camera is in it.", hint=hint, path=path))
    search = FrameSearch(folder, FRAME_FOLDERS, follow_links=follow_links, named_in=path)

    def describe(name: str, element: XmlElement, files: Files) -> DescribedCamera:
        return described(name, element, files, path)

    found, warnings = described_cameras(cameras, search, describe, findings)
    if others:
        warnings.append(f"{path.name} is read; {others[0].name} would work, too.")
    return assemble(folder, format_name, found, problems=findings.problems, warnings=warnings, said_in=path)


def whole_size(width: float, height: float, path: Path, *, what: str) -> tuple[int, int]:
    """Width and height of pictures, px. Raises CaptureError, which begins with `what`, where they are none."""
    is_whole = np.isfinite([width, height]).all() and (width, height) == (round(width), round(height))
    size = parse_size(int(width), int(height)) if is_whole else None
    if size is None:
        raise size_problem(what, float(width), float(height), path)
    return size


def calibrations(folder: Path, suffix: str, is_it: Callable[[Path], bool] | None = None) -> list[Path]:
    """Files that end so, whatever their case, and are what is looked for, the likeliest first."""
    found: list[Path] = []
    for place in PLACES:
        inside = folder / place
        try:
            names = listed(inside, (f".{suffix.rpartition('.')[2]}",)) if inside.is_dir() else []
        except OSError:
            continue
        found += [inside / name for name in names if name.lower().endswith(suffix) and (inside / name).is_file()]
    return found if is_it is None else [path for path in found[:MAX_TRIED] if is_it(path)]


def probe_calibration(folder: Path, suffix: str, is_it: Callable[[Path], bool] | None = None) -> Probe:
    """Whether a folder has such a calibration, and a video or a folder of images where they are looked for."""
    found = calibrations(folder, suffix, is_it)
    if not found:
        return _damaged(folder, suffix) or Probe(False, lacks=f"no {suffix}")
    if (folder / "images").is_dir() or any(_has_video(folder / place) for place in FRAME_FOLDERS):
        return MATCH
    hint = "Put the videos next to it or into videos/, and open the folder above."
    return Probe(False, seen=found[0].relative_to(folder).as_posix(), lacks="no matching video", hint=hint)


def _damaged(folder: Path, suffix: str) -> Probe | None:
    """Names the first file of this suffix that cannot be read; None where all can."""
    for path in calibrations(folder, suffix)[:MAX_TRIED]:
        try:
            read_calibration(path)
        except CaptureError as error:
            seen = f"{path.name}, of which {error.message[0].lower()}{error.message[1:].rstrip('.')}"
            return Probe(False, seen=seen, lacks="that cannot be read", hint=_AGAIN)
    return None


def _has_video(folder: Path) -> bool:
    try:
        return bool(listed(folder, VIDEO_SUFFIXES))
    except OSError:
        return False


def read_calibration(path: Path) -> XmlElement:
    """The root element of a file.

    Raises:
        CaptureError: It cannot be read or is not XML.
    """
    try:
        return read_xml(path)
    except OSError as error:
        text = f"The file cannot be read ({error.strerror})."
        raise CaptureError(text, hint="Check that you may read it.", path=path) from error
    except XmlError as error:
        hint = "It may be cut off or damaged; export it again."
        raise CaptureError(f"The file is not XML ({error}).", hint=hint, path=path) from error


def numbers(element: XmlElement, keys: Sequence[str], path: Path) -> np.ndarray:
    """One number of each attribute. [len(keys)]

    Raises:
        CaptureError: An attribute is missing or not a number.
    """
    return np.array([_number(element.attributes.get(key, ""), key, path) for key in keys])


def numbers_in(element: XmlElement, key: str, count: int, path: Path) -> np.ndarray:
    """As many numbers, separated by blanks, of one attribute, or of the text of the element inside that has the name.
    [count]

    Raises:
        CaptureError: It is missing or has another count, or a word.
    """
    words = element.attributes.get(key, "").split()
    if not words:
        words = [word for child in element.inside(key) for word in child.text.split()]
    if len(words) != count:
        raise CaptureError(f"Its {key} has {len(words)} numbers, not {count}.", hint=_AGAIN, path=path)
    return np.array([_number(word, key, path) for word in words])


def _number(text: str, key: str, path: Path) -> float:
    try:
        return float(text)
    except ValueError:
        raise CaptureError(f"Its {key} is {shown(text)}, not a number.", hint=_AGAIN, path=path) from None


def described_cameras(
    cameras: Sequence[NamedCamera],
    search: FrameSearch,
    describe: Callable[[str, XmlElement, Files], DescribedCamera],
    findings: Findings,
) -> tuple[list[DescribedCamera], list[str]]:
    """Cameras that have frames, in the order in which people count, and notes about how they were found.

    Cameras that only see markers have no video: they are left out where others have one.

    Args:
        cameras: Of the calibration.
        search: Where their frames may be.
        describe: Reads the numbers of one by its name; what it raises is kept with the camera's name.
        findings: Keeps what is wrong.
    """
    ordered = sorted(cameras, key=lambda camera: natural_key(camera.names[0]))
    names = {camera.names[0]: camera.names for camera in ordered}
    assigned, note = findings.tried(lambda: search.assigned(names)) or ({}, "")
    having = [camera for camera in ordered if camera.names[0] in assigned or search.has(camera.names)]
    left_out = [shown(camera.names[0]) for camera in ordered if camera not in having] if having else []
    found: list[DescribedCamera] = []
    for camera in having or ordered:
        name = camera.names[0]
        called = name if is_name(name) else shown(name)
        files: Files | None = assigned.get(name)
        if files is None:
            files = findings.tried(lambda camera=camera: search.files(camera.names), camera=called)
        made = None
        if files is not None:
            made = findings.tried(
                lambda name=name, camera=camera, files=files: describe(name, camera.element, files), camera=called
            )
        if made is not None:
            found.append(made)
    said = [note] if note else []
    if left_out:
        said.append(f"Cameras of the calibration that have no video are left out: {shortened(left_out)}.")
    return found, [*said, *search.left_over()]
