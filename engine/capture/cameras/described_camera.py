"""A camera as a layout describes it, before anything is checked, and what the headers of its files say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from engine.camera.lens import PINHOLE, Lens
from engine.capture.files.media import read_image_header, read_video_header
from engine.capture.frames import FrameSource, ImageFrames, IndexedFrames, VideoFrames, is_turned_as_calibrated
from engine.capture.growing.numbered_files import NumberedFiles
from engine.capture.pixels.transfer_curves import CurveName
from engine.errors import CaptureError


@dataclass(frozen=True, eq=False)
class DescribedCamera:
    """One camera as a layout describes it, not yet checked.

    Attributes:
        name: As the capture calls it.
        K: Intrinsics at the calibrated size, pixel centres at +0.5. [3, 3]
        world_to_camera: OpenCV axes. [4, 4]
        files: Its video, or one image per frame. Places are checked already (`place_in`).
        said_in: The file that its numbers come from, for messages.
        calibrated_size: Width and height that K belongs to; None takes the size of the frames.
        lens: How its lens bends rays.
        masks: A video or one image per frame, bright where something moves; None without.
        color_matrix: New RGB = matrix @ old, on display-encoded values. [3, 3]
        offset_frames: Its own frame is the capture's frame plus this.
        frame_times_s: When each of its frames was taken, in seconds of a clock that all cameras share, rising; None
            where nothing says so. Either all cameras have them or none. [T]
        curve: Transfer curve of its frames, to be undone; None keeps their values.
        frame_indices: Numbers of its own frames that the capture shows, in order; None shows all. [T]
    """

    name: str
    K: np.ndarray
    world_to_camera: np.ndarray
    files: Path | Sequence[Path]
    said_in: Path
    calibrated_size: tuple[int, int] | None = None
    lens: Lens = PINHOLE
    masks: Path | Sequence[Path] | None = None
    color_matrix: np.ndarray | None = None
    offset_frames: float = 0.0
    frame_times_s: np.ndarray | None = None
    frame_indices: Sequence[int] | None = None
    curve: CurveName | None = None


@dataclass(frozen=True, eq=False)
class SeenFiles:
    """The frames of one camera as their headers tell.

    Attributes:
        source: Where they come from.
        size: Width and height.
        rate: Frames per second; 0 where nothing says so.
        paths, n_bytes: Their files, and the sizes of those that were looked at.
        is_even: Whether they were recorded at equal steps of time.
        stated_curve: Transfer curve that they say they are in, other than that of displays; None without.
        is_lying: Whether they stay as they are stored, although the file says that they are to be turned.
    """

    source: FrameSource
    size: tuple[int, int]
    rate: float
    paths: Sequence[Path]
    n_bytes: Sequence[int]
    is_even: bool = True
    is_lying: bool = False
    stated_curve: CurveName | None = None


def seen_files(camera: DescribedCamera, *, is_growing: bool = False) -> SeenFiles:
    """The frames that the capture shows, which then count as evenly recorded. Reads headers.

    Args:
        is_growing: The capture is still being recorded; see engine.capture.growing.
    Raises:
        CaptureError: Files cannot be read, there are none, they differ in size, or chosen frames do not exist.
    """
    files = _look_at(camera, is_growing=is_growing)
    if camera.frame_indices is None:
        return files
    n_frames = files.source.n_frames
    if not camera.frame_indices or not 0 <= min(camera.frame_indices) <= max(camera.frame_indices) < n_frames:
        text = f"The numbers of its frames go beyond the {n_frames} that it has."
        raise CaptureError(text, hint="Correct the list, or take it out.", path=camera.said_in)
    return replace(files, source=IndexedFrames(files.source, camera.frame_indices), rate=0.0, is_even=True)


def _look_at(camera: DescribedCamera, *, is_growing: bool) -> SeenFiles:
    """Headers of a video, or of the first, middle and last image: others are looked at when they are decoded."""
    if isinstance(camera.files, Path):
        header = read_video_header(camera.files, is_growing=is_growing)
        is_turned = camera.calibrated_size is None or is_turned_as_calibrated(header, camera.calibrated_size)
        size = header.size if is_turned else header.stored_size
        source = VideoFrames(
            camera.files, header.n_frames, is_turned=is_turned, is_growing=is_growing, curve=camera.curve
        )
        n_bytes, is_even = [header.n_bytes], header.is_even
        return SeenFiles(source, size, header.rate, [camera.files], n_bytes, is_even, not is_turned, header.curve)
    if isinstance(camera.files, NumberedFiles):
        header = read_image_header(camera.files.seen)  # others may be missing or half-written
        source = ImageFrames(camera.files.seen.parent, camera.files, curve=camera.curve)
        return SeenFiles(source, header.size, 0.0, [camera.files.seen], [header.n_bytes])
    paths = list(camera.files)
    if not paths:
        raise CaptureError("There are no frames.", hint="Add its frames or take the camera out.", path=camera.said_in)
    rows = sorted({0, len(paths) // 2, len(paths) - 1})
    headers = [read_image_header(paths[row]) for row in rows]
    for row, header in zip(rows, headers, strict=True):
        if header.size != headers[0].size:
            first = f"{headers[0].size[0]}x{headers[0].size[1]}"
            text = f"Its frame {row} is {header.size[0]}x{header.size[1]}, its first one {first}."
            raise CaptureError(text, hint="Export all frames of a camera at one size.", path=paths[row])
    source = ImageFrames(paths[0].parent, paths, curve=camera.curve)
    return SeenFiles(source, headers[0].size, 0.0, paths, [header.n_bytes for header in headers])


def mask_source(files: Path | Sequence[Path], frame_indices: Sequence[int] | None) -> FrameSource:
    """Masks in a video or one image each; frame_indices: those that the capture shows, None for all."""
    source: FrameSource
    if isinstance(files, Path):
        source = VideoFrames(files, read_video_header(files).n_frames)
    else:
        source = ImageFrames(files[0].parent, files)
    return source if frame_indices is None else IndexedFrames(source, frame_indices)
