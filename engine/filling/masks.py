"""Parts of masks."""

from __future__ import annotations

import cv2
import numpy as np


def labelled(mask: np.ndarray) -> tuple[np.ndarray, int]:
    """Connected parts of a mask [H, W], corners included.

    Returns:
        Number of each pixel's part, from 1, and 0 outside [H, W] int32; and how many there are.
    """
    n, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    return labels, n - 1
