"""Luminance of display-encoded pictures, for signed differences."""

from __future__ import annotations

import numpy as np

WEIGHTS = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Of red, green and blue: Rec. 709, taken of display-encoded values."""


def luminance_difference(image: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Luminance of one picture less that of another, both [H, W, 3] in 0..1. [H, W] float32 in -1..1"""
    return np.subtract(image, truth, dtype=np.float32) @ WEIGHTS
