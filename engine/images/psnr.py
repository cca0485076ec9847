"""PSNR: how far a picture is from the truth per pixel, in dB; also of a part of the pixels.

Pictures are [H, W, 3] in 0..1, masks [H, W] bool.
"""

from __future__ import annotations

import math

import numpy as np

MAX_PSNR_DB = 100.0
"""Reported for identical pictures, whose PSNR has no finite value."""


def psnr(image: np.ndarray, truth: np.ndarray, mask: np.ndarray | None = None) -> float:
    """20 log10(1 / RMSE) over pixels and channels together, dB, at most MAX_PSNR_DB.

    The image is clamped to 0..1 first. One RMSE over all three channels, not the mean of three figures per channel,
    which is larger. With a mask only its pixels count; NaN for an empty one. Checked against scikit-image.
    """
    return psnr_of(squared_error(image, truth), mask)


def squared_error(image: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Mean over the channels of the squared difference, image clamped to 0..1. [H, W] float64"""
    difference = np.clip(image, 0.0, 1.0).astype(np.float64) - truth
    return np.einsum("hwc,hwc->hw", difference, difference) / difference.shape[2]


def psnr_of(error: np.ndarray, mask: np.ndarray | None = None) -> float:
    """PSNR in dB of a picture from `squared_error`; NaN where no pixel counts."""
    chosen = error if mask is None else error[mask]
    if chosen.size == 0:
        return math.nan
    mean = float(chosen.mean())
    return MAX_PSNR_DB if mean <= 10 ** (-MAX_PSNR_DB / 10) else -10.0 * math.log10(mean)
