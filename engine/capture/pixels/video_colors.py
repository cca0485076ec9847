"""From a decoded video frame to RGB: the matrix and the range that the stream states, or what they mean unstated.

Eight bits per channel come out, whatever the depth of the video. The transfer curve is kept as recorded.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from av.video.reformatter import Colorspace, Interpolation, VideoReformatter

UNSPECIFIED = 2
"""FFmpeg's number of a colour matrix that the stream does not state."""
HD_WIDTH, HD_HEIGHT = 1280, 577
"""From either size on, unstated colours are BT.709, below BT.601, as players have it."""
_EXACT = Interpolation.BILINEAR | Interpolation.ACCURATE_RND | Interpolation.FULL_CHR_H_INT
"""Without the last two, pictures of halved chroma come out darker by one to two of 255."""


def rgb_picture(frame: Any, reformatter: VideoReformatter) -> np.ndarray:
    """A frame (av.VideoFrame) as [H, W, 3] uint8 RGB.

    Args:
        reformatter: Kept by the caller for frames of one video, one thread at a time; it remembers its tables.
    Raises:
        ValueError: A pixel format that cannot be converted.
    """
    is_hd = frame.width >= HD_WIDTH or frame.height >= HD_HEIGHT
    unstated = Colorspace.ITU709 if is_hd else Colorspace.ITU601
    matrix = unstated if frame.colorspace == UNSPECIFIED else None
    return reformatter.reformat(
        frame, format="rgb24", src_colorspace=matrix, interpolation=_EXACT, threads=1
    ).to_ndarray()
