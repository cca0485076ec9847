"""Qualisys: a calibration exported from QTM (*.qca.txt, which is XML), and a video per camera.

Lengths on the sensor are in 64ths of a pixel, counted from the corner of the first one: `sensorMaxU` of a camera of
1920 pixels is 122,879. Distortions belong to normalised coordinates, as in OpenCV, so they are not divided by 64 (which
Pose2Sim does: its converted lenses are nearly straight). `transform` has the place of the camera in the world, in
millimetres, and in its rows the camera's axes: right, up, and backwards. `fov_video` is the part of the sensor that was
recorded, both ends included.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from engine.capture.cameras.described_camera import DescribedCamera
from engine.capture.cameras.motion_capture import (
    MM,
    NamedCamera,
    numbers,
    probe_calibration,
    read_motion_capture,
    whole_size,
)
from engine.capture.cameras.opencv_numbers import lens_of
from engine.capture.files.frame_files import Files
from engine.capture.layout.format_result import Layout, Probe
from engine.errors import CaptureError
from engine.storage.xml_files import XmlElement

FORMAT = "qualisys"
LAYOUT = "a Qualisys calibration (.qca.txt), and a video per camera"
"""The layout in words."""
SUFFIX = ".qca.txt"
PER_PIXEL = 64
_DISTORTIONS = (
    *("radialDistortion1", "radialDistortion2", "tangentalDistortion1", "tangentalDistortion2"),
    "radialDistortion3",
)
"""As the file spells them, in OpenCV's order."""


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
        NamedCamera([element.attributes.get("serial", "")], element)
        for element in root.inside("cameras", "camera")
        if element.attributes.get("active", "1") != "0" and element.attributes.get("calibrated", "true") != "false"
    ]


def _described(name: str, camera: XmlElement, files: Files, path: Path) -> DescribedCamera:
    recorded, transform, intrinsic = (_part(camera, tag, path) for tag in ("fov_video", "transform", "intrinsic"))
    left, top, right, bottom = numbers(recorded, ("left", "top", "right", "bottom"), path)
    width, height = right - left + 1, bottom - top + 1
    size = whole_size(width, height, path, what="Its fov_video has sides of")
    focal_u, focal_v, centre_u, centre_v = (
        numbers(intrinsic, ("focalLengthU", "focalLengthV", "centerPointU", "centerPointV"), path) / PER_PIXEL
    )
    (skew,) = numbers(intrinsic, ("skew",), path) / PER_PIXEL if "skew" in intrinsic.attributes else (0.0,)
    axes = numbers(transform, [f"r{row}{column}" for row in "123" for column in "123"], path).reshape(3, 3)
    pose = np.eye(4)
    pose[:3, :3] = np.diag([1.0, -1.0, -1.0]) @ axes  # from right, up, backwards to right, down, forwards
    pose[:3, 3] = -pose[:3, :3] @ numbers(transform, ("x", "y", "z"), path) * MM
    return DescribedCamera(
        name=name,
        K=np.array([[focal_u, skew, centre_u - left], [0.0, focal_v, centre_v - top], [0.0, 0.0, 1.0]]),
        world_to_camera=pose,
        files=files,
        said_in=path,
        calibrated_size=size,
        lens=lens_of(numbers(intrinsic, _DISTORTIONS, path), is_fisheye=False, path=path),
    )


def _part(camera: XmlElement, tag: str, path: Path) -> XmlElement:
    found = next(camera.inside(tag), None)
    if found is None:
        raise CaptureError(f"It has no {tag}.", hint="Export the calibration again.", path=path)
    return found
