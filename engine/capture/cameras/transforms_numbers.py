"""The numbers of transforms.json: focal lengths or angles of view, lenses, and poses with OpenGL axes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from engine.camera.lens import Lens
from engine.errors import CaptureError
from engine.text import shown

MODELS = {
    "opencv": ("PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "PERSPECTIVE"),
    "fisheye": ("OPENCV_FISHEYE", "FISHEYE"),
}
"""Values of camera_model by the lens that they mean."""
FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
"""From OpenGL to OpenCV axes of a camera."""
HINT = "docs/layouts/transforms_json.md describes the file."


def _number(values: Mapping[str, Any], key: str, default: float | None, path: Path) -> float:
    value = values.get(key, default)
    if not isinstance(value, int | float) or isinstance(value, bool):
        what = "is missing" if value is None else f"is {shown(value)}, not a number"
        raise CaptureError(f"{key} {what}.", hint=HINT, path=path)
    try:
        return float(value)
    except OverflowError:
        return math.inf


def K_of(values: Mapping[str, Any], size: tuple[int, int], path: Path) -> np.ndarray:
    """Intrinsics at this size, pixel centres at +0.5. [3, 3]

    Raises:
        CaptureError: Neither fl_x nor camera_angle_x is there, or something is not a number.
    """
    width, height = size
    from_angle = None
    if "fl_x" not in values:
        from_angle = _focal(_number(values, "camera_angle_x", None, path), width)
    fx = _number(values, "fl_x", from_angle, path)
    other = _focal(_number(values, "camera_angle_y", None, path), height) if "camera_angle_y" in values else fx
    fy = _number(values, "fl_y", fx if "fl_x" in values else other, path)
    cx, cy = _number(values, "cx", width / 2, path), _number(values, "cy", height / 2, path)
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def _focal(angle: float, side: int) -> float:
    """Pixels, of a view of so many radians; NaN of an angle that is none, which check_K then reports."""
    return side / 2 / math.tan(angle / 2) if 0 < angle < math.pi else math.nan


def lens_of(values: Mapping[str, Any], path: Path) -> Lens:
    """The lens of camera_model, k1 to k4, p1 and p2.

    Raises:
        CaptureError: The model is unknown, or has no such parameter.
    """
    stated = values.get("camera_model", "OPENCV_FISHEYE" if values.get("is_fisheye") is True else "OPENCV")
    model = next((name for name, known in MODELS.items() if stated in known), None)
    if model is None:
        known = ", ".join(name for names in MODELS.values() for name in names)
        raise CaptureError(f"Its camera_model is {shown(stated)}.", hint=f"Known are {known}.", path=path)
    k1, k2, k3, k4, p1, p2 = (_number(values, key, 0.0, path) for key in ("k1", "k2", "k3", "k4", "p1", "p2"))
    if model == "fisheye":
        return Lens("fisheye", (k1, k2, k3, k4))
    if k4 != 0:
        text = f"k4 is {k4:g}, which only {MODELS['fisheye'][0]} has."
        raise CaptureError(text, hint="Correct camera_model or k4.", path=path)
    params = (k1, k2, p1, p2, k3)
    return Lens("opencv", params) if any(params) else Lens()


def world_to_camera_of(camera_to_world: np.ndarray, path: Path) -> np.ndarray:
    """The map of a transform_matrix [4, 4]. [4, 4]

    Raises:
        CaptureError: It has NaN, or another last row than 0 0 0 1.
    """
    if not np.isfinite(camera_to_world).all() or not np.array_equal(camera_to_world[3], [0.0, 0.0, 0.0, 1.0]):
        text = "Its transform_matrix has NaN, infinity or a last row that is not 0 0 0 1."
        raise CaptureError(text, hint="Export the cameras again.", path=path)
    pose = camera_to_world @ FLIP
    rotation = pose[:3, :3]
    inverse = np.eye(4)
    inverse[:3, :3] = rotation.T  # check_pose reports when it is not a rotation
    with np.errstate(over="ignore", invalid="ignore"):
        inverse[:3, 3] = -rotation.T @ pose[:3, 3]
    return inverse
