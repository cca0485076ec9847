"""What has arrived of one camera of a capture that is being recorded. Looks at few files, however many there are."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from engine.capture.files.media import VIDEO_FAULTS, opened_video, read_image_header, times_so_far
from engine.capture.frames import FrameSource, ImageFrames, IndexedFrames, VideoFrames
from engine.capture.growing.numbered_files import NumberedFiles
from engine.errors import CaptureError

LOOK_AHEAD = 16
"""Files behind a missing one that are looked for, which tells a lost frame from one that is not recorded yet."""
SETTLED_S = 1.0
"""A file whose kind has no end marker, and a video, counts as complete once it has not changed for so long."""
MARKED = (".jpg", ".jpeg", ".png")
"""Kinds of images whose end tells that they are complete."""
WORK_SHARE = 0.1
"""Share of the time that is spent on reading through a video that grows."""


class Arrivals(Protocol):
    """The frames of one camera, as they come."""

    fault: str
    """Why the next frame does not count, although there is something of it; "" where nothing is there."""

    def has(self, frame_index: int, now_s: float) -> bool:
        """Whether a frame is complete. Frames are asked for in rising order. Raises CaptureError."""
        ...

    def reach(self, frame_index: int) -> int:
        """One past the last frame of which something is there, from a frame on that is missing."""
        ...


def arrivals_of(source: FrameSource, clock: Callable[[], float] = time.monotonic) -> Arrivals:
    """Of the frames of a camera whose capture was read as growing. clock: Seconds, for the cost of reading videos."""
    first = 0
    if isinstance(source, IndexedFrames):
        first, source = int(source.frame_indices[0]), source.source
    match source:
        case ImageFrames(files=NumberedFiles() as files):
            return ImageArrivals(files, first)
        case VideoFrames():
            return VideoArrivals(source.path, first, clock)
    raise TypeError(f"these frames do not grow: {source!r}")


class ImageArrivals:
    """One image per frame. first: The camera's own number of frame 0."""

    def __init__(self, files: NumberedFiles, first: int) -> None:
        self._files, self._first = files, first
        self._changing: tuple[int, int, float] | None = None  # frame, bytes, since when
        self.fault = ""

    def has(self, frame_index: int, now_s: float) -> bool:
        """See `Arrivals`."""
        path = self._files.file(self._first + frame_index)
        self.fault = ""
        if not path.exists():
            return False
        try:
            n_bytes = read_image_header(path).n_bytes
        except CaptureError as error:
            self.fault = error.message.rstrip(".")
            return False
        return path.suffix.lower() in MARKED or self._is_settled(frame_index, n_bytes, now_s)

    def _is_settled(self, frame_index: int, n_bytes: int, now_s: float) -> bool:
        """Whether a file is not written any more: the next one is there, or its size has not changed for a while."""
        if self._files.file(self._first + frame_index + 1).exists():
            return True
        if self._changing is None or self._changing[:2] != (frame_index, n_bytes):
            self._changing = (frame_index, n_bytes, now_s)
        return now_s - self._changing[2] >= SETTLED_S

    def reach(self, frame_index: int) -> int:
        """See `Arrivals`."""
        later = range(frame_index + LOOK_AHEAD, frame_index, -1)
        found = next((one for one in later if self._files.file(self._first + one).exists()), None)
        return frame_index if found is None else found + 1


class VideoArrivals:
    """A video that is being written: fragmented MP4, MKV or a transport stream, which can be read up to their end.

    Frames behind its last key frame count once it has not changed for a while.
    """

    def __init__(self, path: Path, first: int, clock: Callable[[], float]) -> None:
        self._path, self._first, self._clock = path, first, clock
        self._n_bytes, self._changed_s, self._next_s = -1, 0.0, 0.0
        self._n_all = self._n_whole = 0
        self.fault = ""

    def has(self, frame_index: int, now_s: float) -> bool:
        """See `Arrivals`."""
        own = self._first + frame_index
        if own >= self._n_whole and now_s >= self._next_s:
            self._look(now_s)
        is_settled = now_s - self._changed_s >= SETTLED_S
        return own < (self._n_all if is_settled else self._n_whole)

    def reach(self, frame_index: int) -> int:
        """See `Arrivals`."""
        return frame_index  # frames of a video come in order

    def _look(self, now_s: float) -> None:
        try:
            n_bytes = self._path.stat().st_size
        except OSError as error:
            self.fault = f"the video cannot be read ({error.strerror})"
            return
        if n_bytes < self._n_bytes:
            raise CaptureError(
                f"The video has shrunk from {self._n_bytes:,} to {n_bytes:,} bytes, so that it is another one.",
                hint="Record into a new folder, and make a new project of it.",
                path=self._path,
            )
        if n_bytes == self._n_bytes:
            return
        began_s = self._clock()
        try:
            with opened_video(self._path) as container:
                times, n_whole = times_so_far(container, container.streams.video[0])
            self.fault = ""
        except (*VIDEO_FAULTS, OSError, IndexError):
            self.fault = (
                "the video cannot be read before it is finished, as a plain MP4 without its index; record fragmented "
                "MP4, MKV or a transport stream"
            )
            times, n_whole = [], 0
        if len(times) < self._n_all:
            raise CaptureError(
                f"The video had {self._n_all} frames and has {len(times)} now, so that it is another one.",
                hint="Record into a new folder, and make a new project of it.",
                path=self._path,
            )
        self._n_bytes, self._changed_s, self._n_all, self._n_whole = n_bytes, now_s, len(times), n_whole
        self._next_s = now_s + (self._clock() - began_s) / WORK_SHARE
