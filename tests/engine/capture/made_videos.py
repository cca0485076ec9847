"""Writes small videos of many kinds whose frames can be told apart."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np

SIZE = (64, 48)


def numbered(frame_index: int, size: tuple[int, int] = SIZE) -> np.ndarray:
    """A picture that tells its number up to 255 by eight bars, black or white. [H, W, 3] uint8"""
    width, height = size
    bits = np.array([(frame_index >> bit) & 1 for bit in range(8)], np.uint8) * 255
    row = np.repeat(bits, width // 8)
    return np.ascontiguousarray(np.broadcast_to(row[None, :, None], (height, width, 3)))


def number_of(picture: np.ndarray) -> int:
    """Which picture of `numbered` this is."""
    width = picture.shape[1]
    centres = (np.arange(8) * 2 + 1) * width // 16
    return int(((picture[picture.shape[0] // 2, centres].mean(axis=-1) > 127) << np.arange(8)).sum())


def write_video_of_kind(
    path: Path,
    codec: str = "libx264",
    *,
    n_frames: int = 30,
    pix_fmt: str = "yuv420p",
    options: dict[str, str] | None = None,
    times_ms: Sequence[int] | None = None,
    rotation_deg: int = 0,
    is_mirrored: bool = False,
    picture: Callable[[int], np.ndarray] = numbered,
    metadata: dict[str, str] | None = None,
) -> None:
    """A video of this codec. times_ms: when each frame is shown; evenly at 25 per second when None."""
    first = picture(0)
    with av.open(str(path), "w") as container:
        container.metadata.update(metadata or {})
        stream: Any = container.add_stream(codec, rate=25, options=options or {})
        stream.width, stream.height, stream.pix_fmt = first.shape[1], first.shape[0], pix_fmt
        stream.codec_context.time_base = Fraction(1, 25) if times_ms is None else Fraction(1, 1000)
        if rotation_deg or is_mirrored:
            stream.set_display_rotation(rotation_deg, hflip=is_mirrored)
        for index in range(n_frames):
            frame = av.VideoFrame.from_ndarray(picture(index), format="rgb24")
            frame.pts = index if times_ms is None else times_ms[index]
            frame.time_base = stream.codec_context.time_base
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
