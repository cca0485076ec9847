"""From a decoded video frame to RGB: the matrix and the range that the stream states, or what they mean unstated.

Eight bits per channel come out, whatever the depth of the video. The transfer curve is kept as recorded, unless a log
or HDR curve is named.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from av.video.reformatter import Colorspace, Interpolation, VideoReformatter

from engine.capture.pixels.transfer_curves import CurveName, display_levels

FULL_RANGE = 2
"""FFmpeg's number of levels that take all of the range."""
UNSPECIFIED = 2
"""FFmpeg's number of a colour matrix that the stream does not state."""
HD_WIDTH, HD_HEIGHT = 1280, 577
"""From either size on, unstated colours are BT.709, below BT.601, as players have it."""
_EXACT = Interpolation.BILINEAR | Interpolation.ACCURATE_RND | Interpolation.FULL_CHR_H_INT
"""Without the last two, pictures of halved chroma come out darker by one to two of 255."""


def rgb_picture(frame: Any, reformatter: VideoReformatter, curve: CurveName | None = None) -> np.ndarray:
    """A frame (av.VideoFrame) as [H, W, 3] uint8 RGB.

    Args:
        curve: That it was recorded in, to be undone; None keeps values as they are.
        reformatter: Kept by the caller for frames of one video, one thread at a time; it remembers its tables.
    Raises:
        ValueError: A pixel format that cannot be converted.
    """
    is_hd = frame.width >= HD_WIDTH or frame.height >= HD_HEIGHT
    unstated = Colorspace.ITU709 if is_hd else Colorspace.ITU601
    matrix = unstated if frame.colorspace == UNSPECIFIED else None
    depth = "rgb24" if curve is None else "rgb48le"
    picture = reformatter.reformat(
        frame, format=depth, src_colorspace=matrix, interpolation=_EXACT, threads=1
    ).to_ndarray()
    if curve is None:
        return picture
    is_stretched = frame.color_range != FULL_RANGE and frame.format.name.startswith("yuv")
    return display_levels(curve, is_stretched=is_stretched)[np.asarray(picture, np.uint16)]
