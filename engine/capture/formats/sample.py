"""The layout of the shipped sample: cameras.json and one video per camera.

cameras.json: {"schema": 1, "fps", "n_frames", "default_holdout": [names], "cameras": [{"name", "file", "width",
"height", "K" 3x3 in pixels, "world_to_camera" 4x4, OpenCV axes}]}. Files are named relative to the folder.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from engine.capture.checks import (
    check_equal_counts,
    check_image_size,
    check_K,
    check_names,
    check_pose,
    inspect_video,
    parse_matrix,
    raise_problems,
    read_json_object,
)
from engine.capture.frames import VideoFrames
from engine.capture.layout import CameraEntry, Layout
from engine.errors import CaptureError

FORMAT = "sample"
SCHEMA = 1
CAMERAS_FILE = "cameras.json"


def probe(folder: Path) -> str | None:
    """None when the folder looks like this layout, otherwise why not."""
    return None if (folder / CAMERAS_FILE).is_file() else f"no {CAMERAS_FILE}"


def read(folder: Path) -> Layout:
    """Read cameras and the containers of their videos; no pixels.

    Raises:
        CaptureError: Listing every problem found.
    """
    path = folder / CAMERAS_FILE
    document = read_json_object(path)
    if document.get("schema") != SCHEMA:
        raise CaptureError(
            f"The file has schema {document.get('schema')!r}, this program reads {SCHEMA}.",
            hint="Export the capture with a matching version.",
            path=path,
        )
    rows = document.get("cameras")
    if not isinstance(rows, list):
        raise CaptureError('The file has no list "cameras".', hint="Export the capture again.", path=path)

    problems: list[CaptureError] = []
    cameras = [camera for i, row in enumerate(rows) if (camera := _read_camera(i, row, folder, problems)) is not None]
    if cameras or not problems:
        names = [str(row.get("name")) for row in rows if isinstance(row, dict)]
        problems += check_names(names, path)
    fps = _read_fps(document, path, problems)
    problems += _check_counts(cameras, document.get("n_frames"), path)
    holdout = _read_holdout(document, [camera.name for camera in cameras], path, problems)
    raise_problems(problems, folder)
    return Layout(
        format=FORMAT,
        cameras=tuple(cameras),
        n_frames=cameras[0].source.n_frames,
        fps=fps,
        default_holdout=holdout,
    )


def _read_camera(index: int, row: Any, folder: Path, problems: list[CaptureError]) -> CameraEntry | None:
    """One entry of "cameras". Adds its problems; None when there is too little to go on."""
    path = folder / CAMERAS_FILE
    hint = "Export the capture again."
    if not isinstance(row, dict) or not isinstance(row.get("name"), str) or not isinstance(row.get("file"), str):
        problems.append(CaptureError(f"Camera number {index} has no name or no file.", hint=hint, path=path))
        return None
    name, found = row["name"], []
    width, height = row.get("width"), row.get("height")
    size = (width, height) if isinstance(width, int) and isinstance(height, int) else (0, 0)
    if min(size) < 1:
        text = f'Camera "{name}" has width {width!r} and height {height!r}, expected positive whole numbers.'
        problems.append(CaptureError(text, hint=hint, path=path))
        return None
    K, world_to_camera = parse_matrix(row.get("K"), (3, 3)), parse_matrix(row.get("world_to_camera"), (4, 4))
    if K is None:
        found.append(CaptureError(f'Camera "{name}" has no 3x3 matrix K.', hint=hint, path=path))
    else:
        found += check_K(name, K, size, path)
    if world_to_camera is None:
        found.append(CaptureError(f'Camera "{name}" has no 4x4 matrix world_to_camera.', hint=hint, path=path))
    else:
        found += check_pose(name, world_to_camera, path)
    n_frames = _check_video(name, folder / row["file"], size, found)
    problems += found
    if K is None or world_to_camera is None or n_frames is None:
        return None
    return CameraEntry(name, K, world_to_camera, size, VideoFrames(folder / row["file"], n_frames))


def _check_video(name: str, path: Path, size: tuple[int, int], found: list[CaptureError]) -> int | None:
    """Frames in the container, or None when it cannot be used. Adds problems."""
    try:
        n_frames, video_size, _ = inspect_video(path)
    except CaptureError as error:
        found.append(CaptureError(f'Camera "{name}": {error.message}', hint=error.hint, path=error.path))
        return None
    found += check_image_size(name, video_size, size, path)
    return n_frames


def _read_fps(document: dict[str, Any], path: Path, problems: list[CaptureError]) -> float:
    fps = document.get("fps")
    if isinstance(fps, (int, float)) and math.isfinite(fps) and fps > 0:
        return float(fps)
    problems.append(CaptureError(f"fps is {fps!r}.", hint="Give frames per second, above 0.", path=path))
    return 0.0


def _check_counts(cameras: list[CameraEntry], n_listed: Any, path: Path) -> list[CaptureError]:
    counts = {camera.name: camera.source.n_frames for camera in cameras}
    problems = check_equal_counts(counts, {camera.name: camera.source.path for camera in cameras})
    if not problems and counts and n_listed is not None and n_listed != cameras[0].source.n_frames:
        text = f"n_frames is {n_listed!r}, every video has {cameras[0].source.n_frames} frames."
        problems.append(CaptureError(text, hint="Correct the number or export the videos again.", path=path))
    return problems


def _read_holdout(
    document: dict[str, Any], names: list[str], path: Path, problems: list[CaptureError]
) -> tuple[str, ...]:
    holdout = document.get("default_holdout", [])
    if not isinstance(holdout, list) or not all(isinstance(name, str) for name in holdout):
        problems.append(CaptureError("default_holdout is no list of names.", hint="Correct it.", path=path))
        return ()
    unknown = [name for name in holdout if name not in names]
    if unknown and not problems:
        text = f"default_holdout names {', '.join(unknown)}, which the capture does not have."
        problems.append(CaptureError(text, hint="Use names of its cameras.", path=path))
    return tuple(holdout)
