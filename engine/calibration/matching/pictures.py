"""The pictures of each video to match: the scene without moving parts, and some moments for these."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from engine.calibration.videos import PlainVideo
from engine.capture.cameras.camera_optics import resize_area
from engine.cloud.background.background import estimate_background
from engine.images.image_filters import dilate, erode

MAX_SIDE_PX = 1600
"""Larger pictures are matched smaller: key points get no better, and take minutes."""
N_BACKGROUND_FRAMES = 15
N_MOMENTS = 12
"""Moments at which what moves is matched, spread over the videos. They are frames of the background, too."""
MOVING_LEVELS = 20
"""Grey levels, in the channel that differs most, by which something moving differs from the background."""
MIN_MOVING_PIXELS = 150
"""Less that moves than this has no key points worth looking for."""


@dataclass(frozen=True, slots=True)
class MovingPart:
    """The moving pixels of one picture.

    Attributes:
        moment: Its number, from 1.
        picture: A piece of the picture. [h, w, 3] uint8
        corner: x and y of the piece in the picture.
        is_moving: [h, w] bool
    """

    moment: int
    picture: np.ndarray
    corner: tuple[int, int]
    is_moving: np.ndarray


@dataclass(frozen=True, slots=True)
class CameraPictures:
    """The pictures one camera is matched by: background [H, W, 3] uint8, and moving parts in some moments."""

    background: np.ndarray
    moving: tuple[MovingPart, ...]


def chosen_frames(n_frames: int, n: int) -> list[int]:
    """At most n frame indices, spread evenly."""
    return sorted({round(value) for value in np.linspace(0, n_frames - 1, min(n, n_frames))})


def matching_size(size: tuple[int, int]) -> tuple[int, int]:
    """Width and height at which pictures of this size are matched."""
    ratio = min(1.0, MAX_SIDE_PX / max(size))
    return max(1, round(size[0] * ratio)), max(1, round(size[1] * ratio))


def read_pictures(
    video: PlainVideo, n_frames: int, *, n_moments: int = N_MOMENTS, advance: Callable[[float], None] = lambda _: None
) -> CameraPictures:
    """Background and moving parts of one camera.

    Args:
        video: The camera.
        n_frames: Frames that all cameras have; moments are chosen from these, the same for each.
        n_moments: 0 takes backgrounds only.
        advance: Called with the share done since its last call.
    Raises:
        CaptureError: Frames cannot be decoded.
    """
    indices = chosen_frames(n_frames, max(N_BACKGROUND_FRAMES, n_moments))
    size = matching_size(video.size)
    read = []
    for frame in video.source.read(indices):
        read.append(resize_area(frame, size))
        advance(1 / len(indices))
    frames = np.stack(read)
    background = estimate_background(frames).image
    moments = chosen_frames(len(indices), n_moments) if n_moments and len(indices) >= 3 else []
    parts = [_moving_part(number, frames[row], background) for number, row in enumerate(moments, start=1)]
    return CameraPictures(background, tuple(part for part in parts if part is not None))


def _moving_part(moment: int, frame: np.ndarray, background: np.ndarray) -> MovingPart | None:
    differs = np.abs(frame.astype(np.int16) - background).max(-1) > MOVING_LEVELS
    scale = max(1, round(frame.shape[1] / 640))
    is_moving = dilate(erode(differs, scale), 4 * scale)
    if is_moving.sum() < MIN_MOVING_PIXELS * scale**2:
        return None
    rows, columns = np.flatnonzero(is_moving.any(1)), np.flatnonzero(is_moving.any(0))
    margin = 16 * scale
    y0, y1 = max(rows[0] - margin, 0), rows[-1] + 1 + margin
    x0, x1 = max(columns[0] - margin, 0), columns[-1] + 1 + margin
    return MovingPart(moment, frame[y0:y1, x0:x1], (int(x0), int(y0)), is_moving[y0:y1, x0:x1])
