"""Hatching over parts of a picture in which there is nothing to see: plain to anybody, and like nothing in a scene."""

from __future__ import annotations

import numpy as np

DARK, LIGHT = 38, 64
"""Grey levels of the hatching."""
PERIOD_PX = 12
"""From one line to the next, along a row."""
LINE_PX = 3


def hatched(image: np.ndarray, is_seen: np.ndarray) -> np.ndarray:
    """A picture with diagonal lines where nothing is seen.

    Args:
        image: [H, W, 3] uint8
        is_seen: [h, w] bool; of any size, it is brought to that of the image.
    Returns:
        [H, W, 3] uint8; the image itself where all is seen.
    """
    if is_seen.all():
        return image
    height, width = image.shape[:2]
    rows = np.arange(height) * is_seen.shape[0] // height
    columns = np.arange(width) * is_seen.shape[1] // width
    hidden_y, hidden_x = np.nonzero(~is_seen[rows[:, None], columns])
    result = image.copy()
    is_line = (hidden_x + hidden_y) % PERIOD_PX < LINE_PX
    result[hidden_y, hidden_x] = np.where(is_line, LIGHT, DARK).astype(np.uint8)[:, None]
    return result
