"""The motion in the pictures of one camera: how much each pixel changes, and how much it differs from what is usual.

Small pictures, read once and kept as sparse matrices: of a thousand pixels some ten move.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from engine.capture.cameras.camera_optics import resize_area
from engine.capture.frames import FrameSource
from engine.images.image_filters import blurred_difference
from engine.synchronisation.recording import Recording

WIDTH = 320
"""Pictures are looked at at most this wide; finer ones cost more and find the same."""
EVEN_FRAMES = 0.1
"""Times count as even up to this."""
N_USUAL = 25
"""Pictures whose median is what a pixel usually shows."""
NOISE_FACTOR = 6.0
"""A change counts from this many medians of all changes; most of a picture stands still, so its median is noise."""
BLUR_PX = 0.8
MIN_LEVEL = 10.0
"""Sum over RGB, 0..765, below which even noiseless pictures change by compression."""


@dataclass(frozen=True, eq=False)
class MotionPictures:
    """The motion in one camera, over successive frames.

    Attributes:
        changes: Difference from the frame before, 0..1 per pixel; the first row is the second one
            again. Sparse [T, H * W] float32
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
    frames = _small_frames(recording.source, first, last, after_frame)
    spread = np.unique(np.linspace(0, len(frames) - 1, N_USUAL).round().astype(int))
    usual = np.median(frames[spread], axis=0)
    changes = [_weights(frame, before) for frame, before in zip(frames[1:], frames[:-1], strict=True)]
    changes = changes[:1] + changes  # an empty row would be a sudden rest, at the same place in every camera
    presence = [_weights(frame, usual) for frame in frames]
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


def _weights(frame: np.ndarray, reference: np.ndarray) -> sparse.csr_matrix:
    """How sure it is that each pixel differs, 0..1. Sparse [1, H * W]"""
    difference = blurred_difference(frame, reference, sigma_px=BLUR_PX)
    level = max(MIN_LEVEL, NOISE_FACTOR * float(np.median(difference[::2, ::2])))
    return sparse.csr_matrix(np.clip((difference - level) / (2 * level), 0, 1).reshape(1, -1))


def evenly(motion: MotionPictures, fps: float) -> tuple[MotionPictures, float]:
    """The same at even times, mixed from the two frames next to each; and the first of them, in frames of that rate.

    Args:
        motion: At times that may be uneven, or at another rate.
        fps: Frames per second wanted.
    """
    times = motion.times_s * fps
    if len(times) < 2 or np.abs(times - times[0] - np.arange(len(times))).max() < EVEN_FRAMES:
        return motion, float(times[0])
    even = np.arange(times[0], times[-1] + 1e-9)
    after = np.searchsorted(times, even, side="right").clip(1, len(times) - 1)
    share = (even - times[after - 1]) / (times[after] - times[after - 1])
    rows = np.arange(len(even))
    mix = sparse.csr_matrix(
        (np.r_[1 - share, share], (np.r_[rows, rows], np.r_[after - 1, after])), shape=(len(even), len(times))
    )
    changes, presence = sparse.csr_matrix(mix @ motion.changes), sparse.csr_matrix(mix @ motion.presence)
    return MotionPictures(changes, presence, motion.size, even / fps), float(times[0])
