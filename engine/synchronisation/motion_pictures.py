"""What moves in the pictures of one camera: how much each pixel changes, and how much it differs from what is usual.

Small pictures, read once and kept as sparse matrices: of a thousand pixels some ten move.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import ndimage, sparse

from engine.capture.camera_optics import resize_area
from engine.capture.frames import FrameSource
from engine.synchronisation.recording import Recording

WIDTH = 320
"""Pictures are looked at at most this wide; finer ones cost more and find the same."""
N_USUAL = 25
"""Pictures whose median is what a pixel usually shows."""
NOISE_FACTOR = 6.0
"""A change counts from this many medians of all changes; most of a picture stands still, so its median is noise."""
MIN_LEVEL = 10.0
"""Sum over RGB, 0..765, below which even noiseless pictures change by compression."""


@dataclass(frozen=True, eq=False)
class MotionPictures:
    """What moves in one camera, over successive frames.

    Attributes:
        changes: Difference from the frame before, 0..1 per pixel; the first row is empty. Sparse [T, H * W] float32
        presence: Difference from what the pixel usually shows. Sparse [T, H * W] float32
        size: Width and height of the pictures looked at.
        times_s: When each frame was shown, own time. [T] float64
    """

    changes: sparse.csr_matrix
    presence: sparse.csr_matrix
    size: tuple[int, int]
    times_s: np.ndarray


def motion_pictures(
    recording: Recording, first: int, last: int, *, after_frame: Callable[[], None] = lambda: None
) -> MotionPictures:
    """Look at the frames from `first` up to, not including, `last`.

    Raises:
        CaptureError: A frame cannot be read.
    """
    frames = _small_frames(recording.source, first, last, after_frame)  # [T, H, W, 3] float16 would cost precision
    spread = np.unique(np.linspace(0, len(frames) - 1, N_USUAL).round().astype(int))
    usual = ndimage.uniform_filter(np.median(frames[spread], axis=0).astype(np.float32), (3, 3, 1))
    changes, presence = [], []
    before: np.ndarray | None = None
    for frame in frames:
        blurred = ndimage.uniform_filter(frame.astype(np.float32), (3, 3, 1))
        changes.append(_weights(blurred, before))
        presence.append(_weights(blurred, usual))
        before = blurred
    height, width = frames.shape[1:3]
    return MotionPictures(
        sparse.csr_matrix(sparse.vstack(changes)),
        sparse.csr_matrix(sparse.vstack(presence)),
        (width, height),
        recording.times_s[first:last],
    )


def _small_frames(source: FrameSource, first: int, last: int, after_frame: Callable[[], None]) -> np.ndarray:
    frames = []
    for frame in source.read(range(first, last)):
        height, width = frame.shape[:2]
        shrink = min(1.0, WIDTH / width)
        frames.append(resize_area(frame, (max(round(width * shrink), 1), max(round(height * shrink), 1))))
        after_frame()
    return np.stack(frames)


def _weights(frame: np.ndarray, reference: np.ndarray | None) -> sparse.csr_matrix:
    """How sure it is that each pixel differs, 0..1. Sparse [1, H * W]"""
    if reference is None:
        return sparse.csr_matrix((1, frame.shape[0] * frame.shape[1]), dtype=np.float32)
    difference = np.abs(frame - reference).sum(axis=-1)
    level = max(MIN_LEVEL, NOISE_FACTOR * float(np.median(difference)))
    return sparse.csr_matrix(np.clip((difference - level) / (2 * level), 0, 1).reshape(1, -1).astype(np.float32))
