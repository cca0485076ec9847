"""Metashape: cameras exported as XML ("Export Cameras", Agisoft XML), and a video or a folder of images per camera.

Each camera has a sensor, a `transform` (16 numbers, row by row) from the camera (x right, y down, z forward) to the
chunk, and often a component; the chunk's own `transform` leads from there to the world. Of a sensor's `calibration`, f,
cx, cy, b1 and b2 are pixels, cx and cy from the middle of the picture: a point falls at
u = width / 2 + cx + x (f + b1) + y b2, v = height / 2 + cy + y f. p1 and p2 are OpenCV's p2 and p1. Cameras are named
by their labels.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from engine.camera.lens import Lens
from engine.capture.cameras.described_camera import DescribedCamera
from engine.capture.cameras.motion_capture import (
    NamedCamera,
    numbers,
    numbers_in,
    probe_calibration,
    read_calibration,
    read_motion_capture,
    whole_size,
)
from engine.capture.files.frame_files import IMAGE_SUFFIXES, VIDEO_SUFFIXES, Files
from engine.capture.layout.format_result import Layout, Probe
from engine.errors import CaptureError
from engine.storage.xml_files import XmlElement

FORMAT = "metashape"
LAYOUT = "cameras of Metashape (.xml), and a video per camera"
"""The layout in words."""
SUFFIX = ".xml"
LENS_KEYS = ("k1", "k2", "p2", "p1", "k3")
"""As the file spells them, in OpenCV's order."""
_CAMERAS = ("chunk", "cameras")
_OFF = ("false", "0")
"""Of a camera that is switched off, as new and old versions write it."""


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
    return read_motion_capture(
        folder,
        SUFFIX,
        FORMAT,
        cameras_in=_cameras_in,
        described=_described,
        follow_links=follow_links,
        is_it=_is_it,
    )


def _is_it(path: Path) -> bool:
    """Whether a file of XML holds cameras of Metashape."""
    try:
        root = read_calibration(path)
    except CaptureError:
        return False
    return root.tag == "document" and any(True for _ in root.inside(*_CAMERAS))


def _cameras_in(root: XmlElement) -> list[NamedCamera]:
    """Aligned cameras that are enabled, each with what it needs of the chunk."""
    found = []
    for chunk in root.inside("chunk"):
        sensors = {sensor.attributes.get("id", ""): sensor for sensor in chunk.inside("sensors", "sensor")}
        components = {one.attributes.get("id", ""): one for one in chunk.inside("components", "component")}
        cameras = [*chunk.inside("cameras", "camera"), *chunk.inside("cameras", "group", "camera")]
        for camera in cameras:
            if not any(True for _ in camera.inside("transform")) or camera.attributes.get("enabled") in _OFF:
                continue
            places = [
                chunk,
                *([components[own]] if (own := camera.attributes.get("component_id")) in components else []),
            ]
            sensor = sensors.get(camera.attributes.get("sensor_id", ""), XmlElement("sensor", {}))
            label = camera.attributes.get("label", "")
            stem, suffix = os.path.splitext(label)  # of the picture that was aligned
            names = [stem, label] if suffix.lower() in (*IMAGE_SUFFIXES, *VIDEO_SUFFIXES) else [label]
            whole = XmlElement("camera", {}, [camera, sensor, XmlElement("places", {}, places)])
            found.append(NamedCamera(names, whole))
    return found


def _described(name: str, whole: XmlElement, files: Files, path: Path) -> DescribedCamera:
    camera, sensor, places = whole.children
    calibrations = list(sensor.inside("calibration"))
    if not calibrations:
        hint = "Optimise the cameras in Metashape and export them again."
        raise CaptureError("Its sensor has no calibration.", hint=hint, path=path)
    calibration = calibrations[-1]  # the adjusted one comes last
    kind = calibration.attributes.get("type", sensor.attributes.get("type", "frame"))
    if kind != "frame":
        hint = "Choose the camera type Frame in Metashape, and export again."
        raise CaptureError(f"Its sensor is of the type {kind[:40]}, not frame.", hint=hint, path=path)
    resolution = next(calibration.inside("resolution"), next(sensor.inside("resolution"), XmlElement("", {})))
    width, height = numbers(resolution, ("width", "height"), path)
    size = whole_size(width, height, path, what="Its resolution is")
    f = _value(calibration, "f", path)
    if f is None:
        raise CaptureError("Its calibration has no f.", hint="Export the cameras again.", path=path)
    cx, cy, b1, b2, k4, *lens = (
        _value(calibration, key, path) or 0.0 for key in ("cx", "cy", "b1", "b2", "k4", *LENS_KEYS)
    )
    if k4:
        hint = "Fit the lens without k4 in Metashape, and export again."
        raise CaptureError(f"Its lens has k4 = {k4:g}, which is not supported.", hint=hint, path=path)
    if any(_value(calibration, key, path) for key in ("p3", "p4")):
        hint = "Fit the lens without p3 and p4 in Metashape, and export again."
        raise CaptureError("Its lens has p3 and p4, which are not supported.", hint=hint, path=path)
    return DescribedCamera(
        name=name,
        K=np.array([[f + b1, b2, width / 2 + cx], [0.0, f, height / 2 + cy], [0.0, 0.0, 1.0]]),
        world_to_camera=_world_to_camera(camera, places, path),
        files=files,
        said_in=path,
        calibrated_size=size,
        lens=Lens("opencv", tuple(lens)) if any(lens) else Lens(),
    )


def _value(calibration: XmlElement, key: str, path: Path) -> float | None:
    """A number of a calibration; None where it is left out, as what is zero often is."""
    if not any(True for _ in calibration.inside(key)):
        return None
    return float(numbers_in(calibration, key, 1, path)[0])


def _world_to_camera(camera: XmlElement, places: XmlElement, path: Path) -> np.ndarray:
    """Through the component and the chunk, each of which may turn, scale and move. [4, 4]"""
    to_world = numbers_in(camera, "transform", 16, path).reshape(4, 4)
    for place in reversed(places.children):
        for transform in place.inside("transform"):
            turn = (
                numbers_in(transform, "rotation", 9, path).reshape(3, 3) if _has(transform, "rotation") else np.eye(3)
            )
            scale = float(numbers_in(transform, "scale", 1, path)[0]) if _has(transform, "scale") else 1.0
            moved = numbers_in(transform, "translation", 3, path) if _has(transform, "translation") else np.zeros(3)
            to_world[:3, 3] = scale * turn @ to_world[:3, 3] + moved
            to_world[:3, :3] = turn @ to_world[:3, :3]
    pose = np.eye(4)
    pose[:3, :3] = to_world[:3, :3].T
    pose[:3, 3] = -pose[:3, :3] @ to_world[:3, 3]
    return pose


def _has(transform: XmlElement, key: str) -> bool:
    return any(True for _ in transform.inside(key))
