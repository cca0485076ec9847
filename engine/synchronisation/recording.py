"""Recording: what one camera recorded, as far as finding its offset needs it: pictures, their times, the file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from engine.capture.capture import Capture
from engine.capture.files.frame_files import VIDEO_SUFFIXES, listed
from engine.capture.files.media import read_frame_times, read_video_header
from engine.capture.files.places import place_in
from engine.capture.formats.table import FORMATS
from engine.capture.frames import FrameSource, IndexedFrames, VideoFrames
from engine.capture.layout.limits import FPS_RANGE
from engine.errors import CaptureError


@dataclass(frozen=True, eq=False)
class Recording:
    """One camera.

    Attributes:
        name: Its name.
        source: Its pictures; undistorted and of the size of the rig where a rig is given along with it.
        times_s: When each picture is shown, in seconds from the first. [T] float64
        video: The file with sound and tags; None for images.
        start_s: When the first picture is shown, in seconds of that file.
        skipped_s: How long after the first picture in the file that is.
    """

    name: str
    source: FrameSource
    times_s: np.ndarray
    video: Path | None = None
    start_s: float = 0.0
    skipped_s: float = 0.0


class CapturePictures:
    """The pictures of one camera of a capture, undistorted and at working size, as a source."""

    def __init__(self, capture: Capture, camera_index: int) -> None:
        self.path = capture.path
        self.n_frames = capture.n_frames
        self._capture, self._camera_index = capture, camera_index

    def read(self, frame_indices: Sequence[int]) -> Iterator[np.ndarray]:
        """Pictures, each [H, W, 3] uint8 RGB. Raises CaptureError for unreadable data."""
        for frame_index in frame_indices:
            yield self._capture.frame(self._camera_index, frame_index)

    def close(self) -> None:
        """The capture keeps its own files."""


def recordings_of(capture: Capture) -> list[Recording]:
    """The cameras of a capture, by its own clock: what is found is what is left after its offsets were applied.

    Raises:
        CaptureError: A video cannot be read.
    """
    times_s = np.arange(capture.n_frames) / capture.fps
    recordings = []
    for camera_index, name in enumerate(capture.rig.names):
        source, first = capture.store.sources[camera_index], 0
        if isinstance(source, IndexedFrames):
            source, first = source.source, int(source.frame_indices[0])
        pictures = CapturePictures(capture, camera_index)
        if isinstance(source, VideoFrames):
            own_s = read_frame_times(source.path)
            start_s, skipped_s = float(own_s[first]), float(own_s[first] - own_s[0])
            recordings.append(Recording(name, pictures, times_s, source.path, start_s, skipped_s))
        else:
            recordings.append(Recording(name, pictures, times_s))
    return recordings


def recordings_in_videos(videos: Sequence[Path], names: Sequence[str] | None = None) -> list[Recording]:
    """Plain videos without calibration, one per camera.

    Raises:
        CaptureError: A file is missing or not a video, or has a single frame or times that no camera has.
    """
    recordings = []
    for row, path in enumerate(videos):
        header = read_video_header(path)
        times_s = read_frame_times(path)
        _check_times(times_s, path)
        name = path.stem if names is None else names[row]
        source = VideoFrames(path, header.n_frames)
        recordings.append(Recording(name, source, times_s - times_s[0], path, float(times_s[0])))
    return recordings


def _check_times(times_s: np.ndarray, path: Path) -> None:
    """Raise CaptureError where times give no rate that a camera has."""
    if len(times_s) < 2:
        raise CaptureError(
            "The video has 1 frame, so there is nothing to compare.", hint="Remove it from the folder.", path=path
        )
    fps, (low, high) = 1.0 / float(np.median(np.diff(times_s))), FPS_RANGE
    if not low <= fps <= high:
        raise CaptureError(
            f"The times of its frames say {fps:.4g} frames per second; cameras have {low:g} to {high:,.0f}.",
            hint="Copy or export the video again, for example as H.264 in mp4.",
            path=path,
        )


def videos_without_calibration(folder: Path, *, follow_links: bool = False) -> list[Path]:
    """The videos of a folder that is not a capture of any known layout, in natural order; none where it is one.

    Args:
        folder: Where to look.
        follow_links: Whether links in it may lead out of it.
    Raises:
        OSError: The folder cannot be read.
        OutsideError: A video lies elsewhere.
    """
    if not folder.is_dir() or any(reader.probe(folder).is_match for reader in FORMATS):
        return []
    names = listed(folder, VIDEO_SUFFIXES)
    if len(names) < 2:
        return []
    return [place_in(folder, name, follow_links=follow_links, named_in=folder) for name in names]
