"""What readers do differently with a capture that is still being recorded: they take what is there.

Such a capture has as many frames as its farthest camera; those of others may be missing, late or half-written.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from engine.capture.cameras.described_camera import DescribedCamera
from engine.capture.frames import FrameSource, ImageFrames, IndexedFrames, VideoFrames
from engine.capture.growing.numbered_files import NumberedFiles, alike, numbered_files
from engine.capture.layout.format_result import CameraEntry
from engine.errors import CaptureError


def stretched(source: FrameSource, n_frames: int) -> FrameSource:
    """The same frames with so many of them: those that come later, and those that are there already.

    Args:
        source: Of a capture that was read as growing.
    """
    match source:
        case ImageFrames(files=NumberedFiles() as files):
            return ImageFrames(source.path, files.stretched(n_frames), curve=source.curve)
        case VideoFrames():
            return VideoFrames(source.path, n_frames, is_turned=source.is_turned, is_growing=True, curve=source.curve)
        case IndexedFrames():
            first = int(source.frame_indices[0])
            return IndexedFrames(stretched(source.source, first + n_frames), np.arange(first, first + n_frames))
    raise TypeError(f"these frames cannot become more: {source!r}")


def as_long_as_the_longest(entries: Sequence[CameraEntry]) -> list[CameraEntry]:
    """Cameras with as many frames as the one that has most; what others lack is late or lost."""
    n_frames = max((entry.source.n_frames for entry in entries), default=0)
    return [replace(entry, source=stretched(entry.source, n_frames)) for entry in entries]


def check_can_grow(cameras: Sequence[DescribedCamera], folder: Path) -> list[CaptureError]:
    """Cameras whose frames cannot be counted before all of them are there."""
    found = []
    for camera in cameras:
        odd = {
            "times of its frames": camera.frame_times_s,
            "numbers of its frames": camera.frame_indices,
            "masks": camera.masks,
        }
        for what in [what for what, value in odd.items() if value is not None]:
            text = f'Camera "{camera.name}" has {what}, which a capture that is still being recorded cannot have.'
            hint = "Wait for the end of the recording, then use clipgstream train."
            found.append(CaptureError(text, hint=hint, path=folder))
    return found


def numbered(cameras: Sequence[DescribedCamera], folder: Path) -> tuple[list[DescribedCamera], list[CaptureError]]:
    """Cameras whose images count by the numbers in their names, from the lowest number of all; and what is wrong."""
    files: dict[str, NumberedFiles] = {}
    problems = []
    for camera in cameras:
        if not isinstance(camera.files, Path):
            try:
                files[camera.name] = numbered_files(camera.files, folder)
            except CaptureError as error:
                problems.append(error.said_of(f'Camera "{camera.name}"'))
    if problems or not files:
        return list(cameras), problems
    known = dict(zip(files, alike(list(files.values())), strict=True))
    return [replace(camera, files=known.get(camera.name, camera.files)) for camera in cameras], []
