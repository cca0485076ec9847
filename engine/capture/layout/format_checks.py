"""Checks shared by the format readers. Each returns the problems it found as CaptureErrors; readers list them all.

A problem says what was found, with numbers, what to do, and names the file. Nothing is raised here except by
`raise_problems` and the two file readers that cannot continue.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from engine.capture.files.media import ImageHeader
from engine.capture.growing.mode import is_growing
from engine.capture.layout.limits import (
    FOCAL_RANGE,
    FPS_RANGE,
    MAX_META_BYTES,
    MAX_META_VALUES,
    MAX_NAME_LENGTH,
    MAX_PIXELS,
    MAX_POSITION,
    MAX_SIDE,
)
from engine.errors import CaptureError
from engine.storage.files import read_bytes
from engine.storage.json_files import JsonError, parse_json, parse_object
from engine.text import shown

T = TypeVar("T")

ROTATION_TOLERANCE = 1e-3
"""Largest |R R^T - I| entry that counts as a rotation; calibrations printed with four digits reach 3e-4."""
MAX_LISTED = 3
"""File names listed in one message before "and n more"."""


def raise_problems(problems: Sequence[CaptureError], folder: Path) -> None:
    """Raise one CaptureError that lists all problems; do nothing when there are none.

    Raises:
        CaptureError: `problems` is not empty. A single problem is raised as it is.
    """
    if len(problems) == 1:
        raise problems[0]
    if problems:
        raise CaptureError(
            f"The capture has {len(problems)} problems and was not opened.", path=folder, problems=problems
        )


def read_json_object(path: Path) -> dict[str, Any]:
    """Read a JSON file whose top level is an object.

    Raises:
        CaptureError: The file is missing, not readable, too large, not JSON, or something else than an object.
    """
    return _parsed(path, parse_object)


def read_json_list(path: Path) -> list[Any]:
    """Likewise, of a file whose top level is a list."""
    found = _parsed(path, parse_json)
    if isinstance(found, list):
        return found
    hint = "It may be a different file with the same name; export the capture again."
    raise CaptureError("The file holds no list of cameras.", hint=hint, path=path)


def _parsed(path: Path, parse: Callable[..., T]) -> T:
    try:
        data = read_bytes(path, max_bytes=MAX_META_BYTES)
        if data.count(b",") > MAX_META_VALUES:
            text = f"The file has {data.count(b','):,} values, at most {MAX_META_VALUES:,} are read."
            raise CaptureError(text, hint="Keep the calibration in it and take the rest out.", path=path)
        # NaN is let through, so that the camera that has it can be named
        return parse(data, is_nan_allowed=True)
    except FileNotFoundError:
        raise CaptureError("The file is missing.", hint="Put it back or export the capture again.", path=path) from None
    except OSError as error:
        raise CaptureError(
            f"The file cannot be read ({error.strerror}).",
            hint="Check that you may read it.",
            path=path,
        ) from error
    except JsonError as error:
        raise CaptureError(
            f"The file is not valid JSON ({error}).", hint="It may be cut off; export the capture again.", path=path
        ) from error


def is_whole(value: object) -> bool:
    """Whether a JSON value is a whole number; true and false are not."""
    return isinstance(value, int) and not isinstance(value, bool)


def parse_matrix(value: object, shape: tuple[int, ...]) -> np.ndarray | None:
    """Nested lists of numbers as a float64 array of this shape, or None when they are anything else."""
    try:
        matrix = np.asarray(value)
    except (TypeError, ValueError, OverflowError):
        return None
    if matrix.dtype.kind not in "iuf" or matrix.shape != shape:  # texts and objects would become numbers
        return None
    return matrix.astype(np.float64)


def check_names(names: Sequence[str], path: Path) -> list[CaptureError]:
    """Zero cameras, names that occur twice, and names that cannot be shown or typed."""
    if not names:
        return [CaptureError("The capture has no cameras.", hint="List at least one camera with its file.", path=path)]
    problems = [
        CaptureError(f'{count} cameras are called "{name}".', hint="Give each camera its own name.", path=path)
        for name, count in Counter(names).items()
        if count > 1 and is_name(name)
    ]
    odd = [(row, name) for row, name in enumerate(names) if not is_name(name)]
    hint = f"Give it a name of 1 to {MAX_NAME_LENGTH} characters that can be printed."
    return problems + [
        CaptureError(f"Camera number {row} is called {shown(name)}.", hint=hint, path=path) for row, name in odd
    ]


def is_name(name: str) -> bool:
    """Whether a camera may be called so: something that can be read on a screen and typed."""
    return bool(name.strip()) and len(name) <= MAX_NAME_LENGTH and name.isprintable()


def check_fps(fps: object, path: Path) -> list[CaptureError]:
    """Something that is not a number of frames per second, or none that a camera has."""
    low, high = FPS_RANGE
    if isinstance(fps, int | float) and not isinstance(fps, bool) and math.isfinite(fps) and low <= fps <= high:
        return []
    hint = f"Give frames per second, a number from {low:g} to {high:,.0f}."
    return [CaptureError(f"fps is {shown(fps)}.", hint=hint, path=path)]


def parse_size(width: object, height: object) -> tuple[int, int] | None:
    """Width and height as whole numbers of pixels, or None when they are anything else or more than is read."""
    if not (isinstance(width, int) and isinstance(height, int) and is_whole(width) and is_whole(height)):
        return None
    is_in_range = 0 < width <= MAX_SIDE and 0 < height <= MAX_SIDE and width * height <= MAX_PIXELS
    return (width, height) if is_in_range else None


def size_problem(text: str, width: object, height: object, path: Path) -> CaptureError:
    """The error to raise where `parse_size` gives None. text: its subject and verb, such as "w and h are"."""
    return CaptureError(
        f"{text} {shown(width)} and {shown(height)}.",
        hint=f"Give whole numbers from 1 to {MAX_SIDE:,}, at most {MAX_PIXELS:,} pixels.",
        path=path,
    )


def check_pose(name: str, world_to_camera: np.ndarray, path: Path) -> list[CaptureError]:
    """NaN, absurd numbers, a rotation that is not one, a last row other than 0 0 0 1. world_to_camera is [4, 4]."""
    hint = "Export the calibration again as a rigid 4x4 world-to-camera map."
    if not np.isfinite(world_to_camera).all():
        return [CaptureError(f'Camera "{name}" has NaN or infinity in its pose.', hint=hint, path=path)]
    rotation = world_to_camera[:3, :3]
    if np.abs(rotation).max() > 2.0:  # the entries of a rotation are at most 1; squares of 1e300 are infinite
        largest = f"has {np.abs(rotation).max():.3g} in its rotation, whose entries are at most 1"
        return [CaptureError(f'The pose of camera "{name}" {largest}.', hint=hint, path=path)]
    distance = float(np.abs(world_to_camera[:3, 3]).max())
    if distance > MAX_POSITION:
        text = f'The pose of camera "{name}" moves it by {distance:.3g}, at most {MAX_POSITION:g} is read.'
        return [CaptureError(text, hint="Export the calibration in other units or around another origin.", path=path)]
    error = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    determinant = float(np.linalg.det(rotation))
    found = []
    if error > ROTATION_TOLERANCE or determinant < 0:
        found.append(
            "is not a rotation: R R^T differs from the identity by "
            f"{error:.3g}, the determinant is {determinant:.3g} and must be 1"
        )
    if not np.array_equal(world_to_camera[3], [0.0, 0.0, 0.0, 1.0]):
        row = " ".join(f"{value:g}" for value in world_to_camera[3])
        found.append(f"has {row} as its last row, not 0 0 0 1")
    return [CaptureError(f'The pose of camera "{name}" {text}.', hint=hint, path=path) for text in found]


def check_K(name: str, K: np.ndarray, image_size: tuple[int, int], path: Path) -> list[CaptureError]:
    """NaN, a focal length that no camera has, skew, a principal point far outside the image. K is [3, 3]."""
    hint = "Export K as [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] in pixels of the stated image size."
    if not np.isfinite(K).all():
        return [CaptureError(f'Camera "{name}" has NaN or infinity in K.', hint=hint, path=path)]
    if K[0, 0] <= 0 or K[1, 1] <= 0:
        found = [f"fx {K[0, 0]:g} and fy {K[1, 1]:g} must be positive"]
    else:
        found = _focal_faults(K, image_size)
    if not np.allclose(K[2], [0.0, 0.0, 1.0], rtol=0, atol=1e-9):
        found.append("the last row is not 0 0 1")
    centre = K[:2, 2] / np.array(image_size, dtype=np.float64)
    if (centre < -0.5).any() or (centre > 1.5).any():
        size = f"{image_size[0]}x{image_size[1]}"
        found.append(f"the principal point {K[0, 2]:.6g}, {K[1, 2]:.6g} is far outside the {size} image")
    return [CaptureError(f'Camera "{name}" has a bad K: {text}.', hint=hint, path=path) for text in found]


def _focal_faults(K: np.ndarray, image_size: tuple[int, int]) -> list[str]:
    """Of a K with positive focal lengths."""
    low, high = FOCAL_RANGE
    shares = {"fx": K[0, 0] / image_size[0], "fy": K[1, 1] / image_size[1]}
    absurd = [
        f"{key} is {share:.3g} times the side of the image, {low:g} to {high:,.0f} times is read"
        for key, share in shares.items()
        if not low <= share <= high
    ]
    if not absurd and max(abs(K[0, 1]), abs(K[1, 0])) > 1e-6 * K[0, 0]:
        return [f"skew {K[0, 1]:g} is not supported"]
    return absurd


def check_image_size(name: str, found: tuple[int, int], calibrated: tuple[int, int], path: Path) -> list[CaptureError]:
    """Stored frames of another size than the one the calibration belongs to."""
    if found == calibrated:
        return []
    sizes = f"{found[0]}x{found[1]} frames, its calibration is for {calibrated[0]}x{calibrated[1]}"
    return [
        CaptureError(
            f'Camera "{name}" has {sizes}.',
            hint="Export frames at the calibrated size or the calibration for this size.",
            path=path,
        )
    ]


def check_image_header(name: str, header: ImageHeader, calibrated: tuple[int, int], path: Path) -> list[CaptureError]:
    """As `check_image_size`; of a picture that EXIF lays on its side, the text names that as the likely cause."""
    problems = check_image_size(name, header.size, calibrated, path)
    if problems and header.orientation > 4 and header.size[::-1] == calibrated:
        text = f"{problems[0].message} An EXIF entry turns them for display; pictures are read as they are stored."
        hint = "Save the images turned, without the EXIF entry, or calibrate them as they are stored."
        return [CaptureError(text, hint=hint, path=path)]
    return problems


def check_equal_counts(counts: Mapping[str, int], paths: Mapping[str, Path]) -> list[CaptureError]:
    """Cameras whose number of frames differs from that of most cameras; zero frames are named as such. While a capture
    grows they differ."""
    problems = [
        CaptureError(f'Camera "{name}" has no frames.', hint="Add its frames or take the camera out.", path=paths[name])
        for name, count in counts.items()
        if count == 0
    ]
    filled = {name: count for name, count in counts.items() if count > 0}
    usual = Counter(filled.values()).most_common()
    if len(usual) < 2 or is_growing():
        return problems
    expected = max(count for count, votes in usual if votes == usual[0][1])  # a tie goes to the longer one
    n_others = sum(count == expected for count in filled.values())
    problems += [
        CaptureError(
            f'Camera "{name}" has {count} frames, {n_others} other {"camera has" if n_others == 1 else "cameras have"} '
            f"{expected}.",
            hint="Export all cameras over the same frames. While it is still being recorded, use clipgstream follow.",
            path=paths[name],
        )
        for name, count in filled.items()
        if count != expected
    ]
    return problems


def shortened(items: Sequence[str]) -> str:
    """Up to MAX_LISTED items joined by commas, and how many more there are."""
    shown = ", ".join(items[:MAX_LISTED])
    return shown if len(items) <= MAX_LISTED else f"{shown} and {len(items) - MAX_LISTED} more"
