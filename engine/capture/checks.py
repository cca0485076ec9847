"""Checks shared by the format readers. Each returns the problems it found as CaptureErrors; readers list them all.

A problem says what was found, with numbers, what to do, and names the file. Nothing is raised here except by
`raise_problems` and the two file readers that cannot go on.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import av
import av.error
import numpy as np
from PIL import Image, UnidentifiedImageError

from engine.capture.frames import shown_pts
from engine.errors import CaptureError

ROTATION_TOLERANCE = 1e-3
"""Largest |R R^T - I| entry that counts as a rotation; calibrations printed with four digits reach 3e-4."""
MAX_LISTED = 3
"""File names listed in one message before "and n more"."""
END_BYTES = 64
"""Bytes at the end of an image file searched for its end marker; some writers pad behind it."""


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
        CaptureError: The file is missing, not readable, not JSON, or something else than an object.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise CaptureError("The file is missing.", hint="Put it back or export the capture again.", path=path) from None
    except OSError as error:
        raise CaptureError(
            f"The file cannot be read ({error.strerror}).", hint="Check its rights.", path=path
        ) from error
    except (json.JSONDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise CaptureError(
            f"The file is no valid JSON ({error}).", hint="It may be cut off; export the capture again.", path=path
        ) from error
    if not isinstance(document, dict):
        raise CaptureError(
            f"The file holds a JSON {type(document).__name__}, expected an object.",
            hint="Export the capture again.",
            path=path,
        )
    return document


def parse_matrix(value: object, shape: tuple[int, ...]) -> np.ndarray | None:
    """Nested lists as a float64 array of this shape, or None when they are anything else."""
    try:
        matrix = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        return None
    return matrix if matrix.shape == shape else None


def check_names(names: Sequence[str], path: Path) -> list[CaptureError]:
    """Zero cameras and names that occur twice."""
    if not names:
        return [CaptureError("The capture has no cameras.", hint="List at least one camera with its file.", path=path)]
    return [
        CaptureError(f'{count} cameras are called "{name}".', hint="Give each camera its own name.", path=path)
        for name, count in Counter(names).items()
        if count > 1
    ]


def check_pose(name: str, world_to_camera: np.ndarray, path: Path) -> list[CaptureError]:
    """NaN, a rotation that is none, a last row other than 0 0 0 1. world_to_camera is [4, 4]."""
    hint = "Export the calibration again as a rigid 4x4 world-to-camera map."
    if not np.isfinite(world_to_camera).all():
        return [CaptureError(f'Camera "{name}" has NaN or infinity in its pose.', hint=hint, path=path)]
    rotation = world_to_camera[:3, :3]
    error = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    determinant = float(np.linalg.det(rotation))
    found = []
    if error > ROTATION_TOLERANCE or determinant < 0:
        found.append(
            "is no rotation: R R^T differs from the identity by "
            f"{error:.3g}, the determinant is {determinant:.3g} and must be 1"
        )
    if not np.array_equal(world_to_camera[3], [0.0, 0.0, 0.0, 1.0]):
        row = " ".join(f"{value:g}" for value in world_to_camera[3])
        found.append(f"has {row} as its last row, not 0 0 0 1")
    return [CaptureError(f'The pose of camera "{name}" {text}.', hint=hint, path=path) for text in found]


def check_K(name: str, K: np.ndarray, image_size: tuple[int, int], path: Path) -> list[CaptureError]:
    """NaN, a focal length that is not positive, skew, a principal point far outside the image. K is [3, 3]."""
    hint = "Export K as [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] in pixels of the stated image size."
    if not np.isfinite(K).all():
        return [CaptureError(f'Camera "{name}" has NaN or infinity in K.', hint=hint, path=path)]
    found = []
    if K[0, 0] <= 0 or K[1, 1] <= 0:
        found.append(f"fx {K[0, 0]:g} and fy {K[1, 1]:g} must be positive")
    elif max(abs(K[0, 1]), abs(K[1, 0])) > 1e-6 * K[0, 0]:
        found.append(f"skew {K[0, 1]:g} is not supported")
    if not np.allclose(K[2], [0.0, 0.0, 1.0], rtol=0, atol=1e-9):
        found.append("the last row is not 0 0 1")
    centre = K[:2, 2] / np.array(image_size, dtype=np.float64)
    if (centre < -0.5).any() or (centre > 1.5).any():
        size = f"{image_size[0]}x{image_size[1]}"
        found.append(f"the principal point {K[0, 2]:.1f}, {K[1, 2]:.1f} is far outside the {size} image")
    return [CaptureError(f'Camera "{name}" has a bad K: {text}.', hint=hint, path=path) for text in found]


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


def check_equal_counts(counts: Mapping[str, int], paths: Mapping[str, Path]) -> list[CaptureError]:
    """Cameras whose number of frames differs from that of most cameras; zero frames are named as such."""
    problems = [
        CaptureError(f'Camera "{name}" has no frames.', hint="Add its frames or take the camera out.", path=paths[name])
        for name, count in counts.items()
        if count == 0
    ]
    filled = {name: count for name, count in counts.items() if count > 0}
    usual = Counter(filled.values()).most_common()
    if len(usual) < 2:
        return problems
    expected = max(count for count, votes in usual if votes == usual[0][1])  # a tie goes to the longer one
    n_others = sum(count == expected for count in filled.values())
    problems += [
        CaptureError(
            f'Camera "{name}" has {count} frames, {n_others} other {"camera has" if n_others == 1 else "cameras have"} '
            f"{expected}.",
            hint="Export all cameras over the same frames.",
            path=paths[name],
        )
        for name, count in filled.items()
        if count != expected
    ]
    return problems


def check_image_file(path: Path) -> str | None:
    """What is wrong with an image file as far as its ends tell, without decoding it; None when nothing is.

    Only JPEG and PNG carry an end marker; for other formats an empty file is all that shows here.
    """
    with path.open("rb") as file:
        head = file.read(8)
        n_bytes = file.seek(0, 2)
        file.seek(max(n_bytes - END_BYTES, 0))
        tail = file.read()
    if n_bytes == 0:
        return "is empty"
    if path.suffix.lower() in (".jpg", ".jpeg"):
        is_kind, is_complete, kind = head[:2] == b"\xff\xd8", b"\xff\xd9" in tail, "JPEG"
    elif path.suffix.lower() == ".png":
        is_kind, is_complete, kind = head == b"\x89PNG\r\n\x1a\n", b"IEND" in tail, "PNG"
    else:
        return None
    if not is_kind:
        return f"is no {kind}"
    return None if is_complete else f"is truncated: the {kind} ends after {n_bytes} bytes without its end marker"


def image_size_of(path: Path) -> tuple[int, int]:
    """Width and height from the header of an image file.

    Raises:
        CaptureError: No image header.
    """
    try:
        with Image.open(path) as image:
            return image.size
    except (OSError, UnidentifiedImageError, SyntaxError) as error:
        raise CaptureError(
            "The file is no readable image.", hint="Copy or export this file again.", path=path
        ) from error


def inspect_video(path: Path) -> tuple[int, tuple[int, int], float]:
    """Number of frames, size and rate of a video from its container; no pixel is decoded.

    Returns:
        n_frames; width and height; frames per second (0 when the container does not say).
    Raises:
        CaptureError: The file is missing, no video, or ends before the frames that its index lists.
    """
    if not path.is_file():
        raise CaptureError("The video is missing.", hint="Put the file back or take its camera out.", path=path)
    n_bytes = path.stat().st_size
    if n_bytes == 0:
        raise CaptureError("The video is empty (0 bytes).", hint="Copy or export it again.", path=path)
    try:
        with av.open(str(path)) as container:
            if not container.streams.video:
                raise CaptureError(
                    "The file has no video stream, so it is truncated or no video.",
                    hint="Copy or export it again.",
                    path=path,
                )
            stream = container.streams.video[0]
            size = (stream.codec_context.width, stream.codec_context.height)
            rate = float(stream.average_rate or 0)
            entries = [entry for entry in stream.index_entries if not entry.is_discard]
            if len(entries) != stream.frames or not entries:  # the index lists key frames only, or frames not shown
                return sum(shown_pts(packet) is not None for packet in container.demux(stream)), size, rate
            n_whole = sum(entry.pos + entry.size <= n_bytes for entry in entries)
    except av.error.FFmpegError as error:
        raise CaptureError(
            f"The video cannot be opened ({error.strerror}), so it is truncated or of an unknown kind.",
            hint="Copy or export it again, for example as H.264 in mp4.",
            path=path,
        ) from error
    if n_whole < len(entries):
        raise CaptureError(
            f"The video is truncated: its index lists {len(entries)} frames, "
            f"only {n_whole} lie within its {n_bytes} bytes.",
            hint="Copy or export it again.",
            path=path,
        )
    return len(entries), size, rate


def shortened(items: Sequence[str]) -> str:
    """Up to MAX_LISTED items joined by commas, and how many more there are."""
    shown = ", ".join(items[:MAX_LISTED])
    return shown if len(items) <= MAX_LISTED else f"{shown} and {len(items) - MAX_LISTED} more"
