"""RealityCapture and RealityScan: an XMP file per camera ("Metadata (XMP)"), and a video or a folder of images of its
name.

`xcr:Rotation` turns the world to the camera (x right, y down, z forward), row by row, `xcr:Position` is the camera's
place. FocalLength35mm is for a picture whose longer side is 36 mm; PrincipalPointU and V are counted from the middle of
the picture, as shares of its longer side. DistortionCoeficients, spelled so, are k1 k2 k3 k4 and two tangential ones.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from engine.camera.lens import Lens
from engine.capture.cameras.described_camera import DescribedCamera, seen_files
from engine.capture.cameras.motion_capture import (
    FRAME_FOLDERS,
    NamedCamera,
    calibrations,
    described_cameras,
    numbers,
    numbers_in,
    probe_calibration,
    read_calibration,
)
from engine.capture.files.frame_files import Files
from engine.capture.files.frame_search import FrameSearch
from engine.capture.layout.assembling import assemble
from engine.capture.layout.findings import Findings
from engine.capture.layout.format_result import Layout, Probe
from engine.errors import CaptureError
from engine.storage.xml_files import XmlElement

FORMAT = "realitycapture"
LAYOUT = "XMP files of RealityCapture, and a video per camera"
"""The layout in words."""
SUFFIX = ".xmp"
FILM_MM = 36.0
DESCRIPTION = ("rdf:RDF", "rdf:Description")


def probe(folder: Path) -> Probe:
    """Whether the folder looks like this layout."""
    return probe_calibration(folder, SUFFIX, _is_it)


def read(folder: Path, *, follow_links: bool = False) -> Layout:
    """Read cameras and the headers of their frames; no pixels.

    Args:
        follow_links: Whether frames may lie outside of the folder.
    Raises:
        CaptureError: Listing every problem found.
    """
    findings = Findings()
    paths: dict[str, Path] = {}
    cameras: list[NamedCamera] = []
    for path in calibrations(folder, SUFFIX):
        root = findings.tried(lambda path=path: read_calibration(path))
        description = None if root is None else next(root.inside(*DESCRIPTION), None)
        if description is not None and path.stem not in paths:
            paths[path.stem] = path
            cameras.append(NamedCamera([path.stem], description))
    said_in = next(iter(paths.values()), folder)
    search = FrameSearch(folder, FRAME_FOLDERS, follow_links=follow_links, named_in=said_in)

    def describe(name: str, element: XmlElement, files: Files) -> DescribedCamera:
        return _described(name, element, files, paths[name])

    found, notes = described_cameras(cameras, search, describe, findings)
    return assemble(folder, FORMAT, found, problems=findings.problems, warnings=notes, said_in=said_in)


def _is_it(path: Path) -> bool:
    """Whether a file of XMP holds a camera of RealityCapture: those of photographs have no pose."""
    try:
        root = read_calibration(path)
    except CaptureError:
        return False
    return any(True for _ in root.inside(*DESCRIPTION, "xcr:Rotation"))


def _described(name: str, element: XmlElement, files: Files, path: Path) -> DescribedCamera:
    bare = DescribedCamera(name, np.eye(3), np.eye(4), files, path)
    width, height = seen_files(bare).size  # the file has none: everything is a share of the picture
    longer = max(width, height)
    focal_mm, u, v = numbers(element, ("xcr:FocalLength35mm", "xcr:PrincipalPointU", "xcr:PrincipalPointV"), path)
    aspect, skew = (
        float(numbers(element, (key,), path)[0]) if key in element.attributes else usual
        for key, usual in (("xcr:AspectRatio", 1.0), ("xcr:Skew", 0.0))
    )
    focal = focal_mm / FILM_MM * longer
    pose = np.eye(4)
    pose[:3, :3] = numbers_in(element, "xcr:Rotation", 9, path).reshape(3, 3)
    pose[:3, 3] = -pose[:3, :3] @ numbers_in(element, "xcr:Position", 3, path)
    return DescribedCamera(
        name=name,
        K=np.array(
            [[focal, skew, width / 2 + u * longer], [0.0, focal * aspect, height / 2 + v * longer], [0.0, 0.0, 1.0]]
        ),
        world_to_camera=pose,
        files=files,
        said_in=path,
        lens=_lens(element, path),
    )


def _lens(element: XmlElement, path: Path) -> Lens:
    model = element.attributes.get("xcr:DistortionModel", "none")
    if model in ("none", "perspective") or not any(True for _ in element.inside("xcr:DistortionCoeficients")):
        return Lens()
    k1, k2, k3, k4, t1, t2 = numbers_in(element, "xcr:DistortionCoeficients", 6, path)
    if not model.startswith("brown") or k4:
        what = f"the model {model[:40]}" if not model.startswith("brown") else f"k4 = {k4:g}"
        hint = "Align with the model Brown3 in RealityCapture, and export again."
        raise CaptureError(f"Its lens has {what}, which is not supported.", hint=hint, path=path)
    return Lens("opencv", (k1, k2, t1, t2, k3)) if np.any([k1, k2, t1, t2, k3]) else Lens()
