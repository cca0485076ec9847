"""The layout of the shipped sample: cameras.json and one video per camera.

cameras.json: {"schema": 1, "fps", "n_frames", "default_holdout": [names], "cameras": [{"name", "file", "width",
"height", "K" 3x3 in pixels, "world_to_camera" 4x4, OpenCV axes}]}. Files are named relative to the folder.
"""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from engine.capture.files.duplicates import CameraFiles, check_duplicates
from engine.capture.files.media import VideoHeader, read_video_header
from engine.capture.files.places import place_in
from engine.capture.frames import VideoFrames, is_turned_as_calibrated
from engine.capture.growing.mode import is_growing
from engine.capture.growing.reading import as_long_as_the_longest
from engine.capture.layout.format_checks import (
    check_equal_counts,
    check_fps,
    check_image_size,
    check_K,
    check_names,
    check_pose,
    is_name,
    is_whole,
    parse_matrix,
    parse_size,
    raise_problems,
    read_json_object,
    shortened,
    size_problem,
)
from engine.capture.layout.format_result import MATCH, CameraEntry, Layout, Probe
from engine.errors import CaptureError
from engine.text import shown

FORMAT = "sample"
LAYOUT = "cameras.json and one video per camera"
"""The layout in words."""
SCHEMA = 1
CAMERAS_FILE = "cameras.json"


THREADS = 4
"""Videos looked at side by side: FFmpeg works, or waits for the disk, without the interpreter."""
RATE_TOLERANCE = 0.01
"""Share by which the rate of a video may differ from fps, as 29.97 does from 30."""


@dataclass(slots=True)
class _Reading:
    """The findings of reading so far.

    Attributes:
        headers: Of the videos that could be opened, by camera.
        is_growing: Whether the capture is still being recorded.
        looks: Places and headers of all videos, by the name of their file, as they are looked at by a few threads.
    """

    folder: Path
    follow_links: bool
    is_growing: bool
    problems: list[CaptureError] = field(default_factory=list)
    headers: dict[str, VideoHeader] = field(default_factory=dict)
    looks: dict[str, Future[tuple[Path, VideoHeader]]] = field(default_factory=dict)


def probe(folder: Path) -> Probe:
    """Whether the folder looks like this layout."""
    path = folder / CAMERAS_FILE
    if path.is_file():
        return MATCH
    return Probe(False, lacks=f"{CAMERAS_FILE} is not a file" if path.exists() else f"no {CAMERAS_FILE}")


def read(folder: Path, *, follow_links: bool = False) -> Layout:
    """Read cameras and the containers of their videos; no pixels.

    Args:
        follow_links: Whether videos may lie outside of the folder.
    Raises:
        CaptureError: Listing every problem found.
    """
    path = folder / CAMERAS_FILE
    document = read_json_object(path)
    schema = document.get("schema")
    if not is_whole(schema) or schema != SCHEMA:
        raise CaptureError(
            f"The file has schema {shown(schema)}, this program reads {SCHEMA}.",
            hint="Export the capture with a matching version.",
            path=path,
        )
    rows = document.get("cameras")
    if not isinstance(rows, list):
        raise CaptureError('The file has no list "cameras".', hint="Export the capture again.", path=path)

    reading = _Reading(folder, follow_links, is_growing())
    problems = reading.problems
    with ThreadPoolExecutor(THREADS) as pool:
        for row in rows:
            if isinstance(row, dict) and isinstance(row.get("file"), str) and row["file"] not in reading.looks:
                reading.looks[row["file"]] = pool.submit(_look_at_video, reading, row["file"])
        cameras = [camera for i, row in enumerate(rows) if (camera := _read_camera(i, row, reading)) is not None]
    if cameras or not problems:
        names = [row["name"] for row in rows if isinstance(row, dict) and isinstance(row.get("name"), str)]
        problems += check_names(names, path)
    fps = document.get("fps")
    problems += check_fps(fps, path)
    problems += _check_counts(cameras, document.get("n_frames"), path)
    if not problems:  # names are unique from here on
        problems += check_duplicates(
            {
                camera.name: CameraFiles([camera.source.path], [reading.headers[camera.name].n_bytes])
                for camera in cameras
            }
        )
    holdout = _read_holdout(document, {camera.name for camera in cameras}, path, problems)
    raise_problems(problems, folder)
    if reading.is_growing:
        cameras = as_long_as_the_longest(cameras)
    return Layout(
        format=FORMAT,
        cameras=tuple(cameras),
        n_frames=cameras[0].source.n_frames,
        fps=float(document["fps"]),
        default_holdout=holdout,
        warnings=tuple(_warnings(document, reading.headers, {camera.name: camera.image_size for camera in cameras})),
        is_growing=reading.is_growing,
    )


def _warnings(
    document: dict[str, Any], headers: dict[str, VideoHeader], sizes: dict[str, tuple[int, int]]
) -> list[str]:
    """Odd but usable: a length that is not stated, turned videos, rates of videos that are missing or others."""
    fps, warnings = document["fps"], []
    if document.get("n_frames") is None and not is_growing():
        n_frames = next(iter(headers.values())).n_frames
        warnings.append(
            f"{CAMERAS_FILE} does not state n_frames; the {n_frames} frames of the videos are taken. Add it, so that "
            "videos cut short alike are noticed."
        )
    lying = [name for name, header in headers.items() if not is_turned_as_calibrated(header, sizes[name])]
    if lying:
        warnings.append(
            f"These videos ask to be rotated for display: {shortened(lying)}. Only the stored orientation matches "
            "their calibration, so they are not rotated."
        )
    unstated = [name for name, header in headers.items() if header.rate <= 0]
    if unstated:
        warnings.append(
            f"Videos that state no frame rate: {shortened(unstated)}. The {fps:g} per second given by fps is used."
        )
    others = {name: header.rate for name, header in headers.items() if abs(header.rate - fps) > RATE_TOLERANCE * fps}
    others = {name: rate for name, rate in others.items() if rate > 0}
    if others:
        listed = shortened([f"{name} {rate:g}" for name, rate in others.items()])
        warnings.append(
            f"fps is {fps:g}, but these videos state another rate: {listed}. Frames are taken one by one and shown at "
            f"{fps:g} per second; correct fps if that is wrong."
        )
    return warnings


def _look_at_video(reading: _Reading, name: str) -> tuple[Path, VideoHeader]:
    named_in = reading.folder / CAMERAS_FILE
    place = place_in(reading.folder, name, follow_links=reading.follow_links, named_in=named_in)
    return place, read_video_header(place, is_growing=reading.is_growing)


def _read_camera(index: int, row: Any, reading: _Reading) -> CameraEntry | None:
    """One entry of "cameras". Adds its problems; None when there is too little to continue."""
    path = reading.folder / CAMERAS_FILE
    hint = "Export the capture again."
    if not isinstance(row, dict) or not isinstance(row.get("name"), str) or not isinstance(row.get("file"), str):
        reading.problems.append(CaptureError(f"Camera number {index} has no name or no file.", hint=hint, path=path))
        return None
    name = row["name"] if is_name(row["name"]) else shown(row["name"])
    size = parse_size(row.get("width"), row.get("height"))
    if size is None:
        text = f'Camera "{name}" has width and height'
        reading.problems.append(size_problem(text, row.get("width"), row.get("height"), path))
        return None
    found: list[CaptureError] = []
    K, world_to_camera = parse_matrix(row.get("K"), (3, 3)), parse_matrix(row.get("world_to_camera"), (4, 4))
    if K is None:
        found.append(CaptureError(f'Camera "{name}" has no 3x3 matrix K of numbers.', hint=hint, path=path))
    else:
        found += check_K(name, K, size, path)
    if world_to_camera is None:
        found.append(
            CaptureError(f'Camera "{name}" has no 4x4 matrix world_to_camera of numbers.', hint=hint, path=path)
        )
    else:
        found += check_pose(name, world_to_camera, path)
    header, place, is_turned = None, reading.folder, True
    try:
        place, header = reading.looks[row["file"]].result()
        is_turned = is_turned_as_calibrated(header, size)
        found += check_image_size(name, header.size if is_turned else header.stored_size, size, place)
    except CaptureError as error:
        found.append(error.said_of(f'Camera "{name}"'))
    reading.problems += found
    if K is None or world_to_camera is None or header is None:
        return None
    reading.headers[name] = header
    source = VideoFrames(place, header.n_frames, is_turned=is_turned, is_growing=reading.is_growing)
    return CameraEntry(name, K, world_to_camera, size, source)


def _check_counts(cameras: list[CameraEntry], n_listed: Any, path: Path) -> list[CaptureError]:
    counts = {camera.name: camera.source.n_frames for camera in cameras}
    problems = check_equal_counts(counts, {camera.name: camera.source.path for camera in cameras})
    n_frames = next(iter(counts.values()), None)
    is_stated = n_listed is not None and not is_growing()
    if not problems and counts and is_stated and (not is_whole(n_listed) or n_listed != n_frames):
        text = f"n_frames is {shown(n_listed)}, every video has {n_frames} frames."
        problems.append(CaptureError(text, hint="Correct the number or export the videos again.", path=path))
    return problems


def _read_holdout(
    document: dict[str, Any], names: set[str], path: Path, problems: list[CaptureError]
) -> tuple[str, ...]:
    holdout = document.get("default_holdout", [])
    if not isinstance(holdout, list) or not all(isinstance(name, str) for name in holdout):
        problems.append(CaptureError("default_holdout is not a list of names.", hint="Correct it.", path=path))
        return ()
    unknown = [name for name in holdout if name not in names]
    if unknown and not problems:
        listed = shortened([shown(name)[1:-1] for name in unknown])
        text = f"default_holdout names {listed}, which the capture does not have."
        problems.append(CaptureError(text, hint="Use names of its cameras.", path=path))
    return tuple(dict.fromkeys(holdout))
