"""Vicon: a calibration (*.xcp, which is XML) and a video per video camera.

ORIENTATION is the quaternion x y z w that turns the world to the camera (x right, y down, z forward), POSITION the
camera's place in millimetres. FOCAL_LENGTH and PRINCIPAL_POINT are in pixels, PIXEL_ASPECT_RATIO is fx / fy. The lens
is a correction: a point that was seen at a distance r from the centre, in pixels, belongs at
1 + k1 r^2 + k2 r^4 + k3 r^6 times that distance. VICON_RADIAL2 holds "Vicon3Parameter", the centre and k1 to k3; the
older VICON_RADIAL holds k1 and k2 about the principal point.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from engine.camera.rotations import matrices_of
from engine.capture.cameras.corrected_lens import lens_of_correction
from engine.capture.cameras.described_camera import DescribedCamera
from engine.capture.cameras.motion_capture import (
    MM,
    NamedCamera,
    numbers,
    numbers_in,
    probe_calibration,
    read_motion_capture,
    whole_size,
)
from engine.capture.files.frame_files import Files
from engine.capture.layout.format_result import Layout, Probe
from engine.errors import CaptureError
from engine.storage.xml_files import XmlElement

FORMAT = "vicon"
LAYOUT = "a Vicon calibration (.xcp), and a video per camera"
"""The layout in words."""
SUFFIX = ".xcp"
MODEL = "Vicon3Parameter"


def probe(folder: Path) -> Probe:
    """Whether the folder looks like this layout."""
    return probe_calibration(folder, SUFFIX)


def read(folder: Path, *, follow_links: bool = False) -> Layout:
    """Read cameras and the headers of their frames; no pixels.

    Args:
        follow_links: Whether frames may lie outside of the folder.
    Raises:
        CaptureError: Listing every problem found.
    """
    return read_motion_capture(
        folder, SUFFIX, FORMAT, cameras_in=_cameras_in, described=_described, follow_links=follow_links
    )


def _cameras_in(root: XmlElement) -> list[NamedCamera]:
    return [
        NamedCamera(
            [name for key in ("DEVICEID", "NAME", "LABEL") if (name := element.attributes.get(key))] or [""], element
        )
        for element in root.inside("Camera")
        if any(True for _ in element.inside("KeyFrames", "KeyFrame"))
    ]


def _described(name: str, camera: XmlElement, files: Files, path: Path) -> DescribedCamera:
    state, *later = camera.inside("KeyFrames", "KeyFrame")
    if any(
        frame.attributes.get(key) != state.attributes.get(key) for frame in later for key in ("POSITION", "ORIENTATION")
    ):
        hint = "Use a recording of cameras that stand still."
        raise CaptureError("The camera moves: it has several key frames.", hint=hint, path=path)
    width, height = numbers_in(camera, "SENSOR_SIZE", 2, path)
    size = whole_size(width, height, path, what="Its SENSOR_SIZE is")
    (focal,) = numbers(state, ("FOCAL_LENGTH",), path)
    (aspect,) = numbers(camera, ("PIXEL_ASPECT_RATIO",), path) if "PIXEL_ASPECT_RATIO" in camera.attributes else (1.0,)
    if not aspect > 0:
        text = f"Its PIXEL_ASPECT_RATIO is {aspect:g}."
        raise CaptureError(text, hint="Export the calibration again.", path=path)
    centre = numbers_in(state, "PRINCIPAL_POINT", 2, path)
    K = np.array([[focal, 0.0, centre[0]], [0.0, focal / aspect, centre[1]], [0.0, 0.0, 1.0]])
    quat = numbers_in(state, "ORIENTATION", 4, path)[[3, 0, 1, 2]]
    length = float(np.linalg.norm(quat))
    if not 0.9 < length < 1.1:
        text = f"Its ORIENTATION has a length of {length:.3g}, not 1."
        raise CaptureError(text, hint="Export the calibration again.", path=path)
    pose = np.eye(4)
    pose[:3, :3] = matrices_of(quat / length)
    pose[:3, 3] = -pose[:3, :3] @ numbers_in(state, "POSITION", 3, path) * MM
    return DescribedCamera(
        name=name,
        K=K,
        world_to_camera=pose,
        files=files,
        said_in=path,
        calibrated_size=size,
        lens=lens_of_correction(K, size, *_correction(state, centre, path), path=path),
    )


def _correction(state: XmlElement, principal: np.ndarray, path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Centre [2] and coefficients [3] of r^2, r^4 and r^6, in pixels."""
    newer = state.attributes.get("VICON_RADIAL2", "").split()
    if newer:
        if newer[0] != MODEL:
            text = f"Its lens has the unknown model {newer[0][:40]}."
            raise CaptureError(text, hint=f"Calibrate with {MODEL}.", path=path)
        plain = XmlElement("", {"VICON_RADIAL2": " ".join(newer[1:])})
        values = numbers_in(plain, "VICON_RADIAL2", 5, path)
        return values[:2], values[2:]
    if "VICON_RADIAL" in state.attributes:
        return principal, np.append(numbers_in(state, "VICON_RADIAL", 2, path), 0.0)
    return principal, np.zeros(3)
