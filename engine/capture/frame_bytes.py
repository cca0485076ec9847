"""How many bytes the stored frames of a capture have: what reading them moves. Nothing is decoded."""

from __future__ import annotations

import os
import statistics
from pathlib import Path

from engine.capture.capture import Capture
from engine.capture.frames import FrameSource, ImageFrames, IndexedFrames
from engine.errors import CaptureError

MAX_LOOKED_AT = 64
"""Image files of a camera whose sizes stand for all of them, spread over its frames."""


def frame_bytes(capture: Capture) -> list[float]:
    """Bytes of a stored frame of every camera, with its mask where there is one: the mean over its image files, or the
    share that a frame has of its video.

    Raises:
        CaptureError: A file is gone.
    """
    store = capture.store
    pairs = zip(store.sources, store.masks, strict=True)
    return [_of_source(source) + (0.0 if masks is None else _of_source(masks)) for source, masks in pairs]


def _of_source(source: FrameSource) -> float:
    if isinstance(source, IndexedFrames):  # some of its frames, some twice
        source = source.source
    if isinstance(source, ImageFrames):
        step = -(-len(source.files) // MAX_LOOKED_AT)
        return statistics.fmean(_size(path) for path in source.files[::step])
    return _size(source.path) / source.n_frames


def _size(path: Path) -> int:
    try:
        return os.stat(path).st_size
    except OSError as error:
        raise CaptureError(
            f"A file of the capture cannot be read ({error.strerror}).", hint="Put it back.", path=path
        ) from error
