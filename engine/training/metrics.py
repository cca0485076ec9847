"""Picture metrics: PSNR, SSIM, and the least-squares colour fit that separates colour casts from shape errors.

Pictures are [H, W, 3] in 0..1. Masks are [H, W] bool.
"""

from __future__ import annotations

import math

import numpy as np
import torch

from engine.training.losses import ssim_map

MAX_PSNR_DB = 100.0
"""Reported for identical pictures, whose PSNR has no finite value."""


def psnr(image: np.ndarray, truth: np.ndarray, mask: np.ndarray | None = None) -> float:
    """20 log10(1 / RMSE) over all channels, dB; the image is clamped to 0..1 first. NaN for an empty mask."""
    error = (np.clip(image, 0.0, 1.0).astype(np.float64) - truth) ** 2
    if mask is not None:
        error = error[mask]
    if error.size == 0:
        return math.nan
    mean = float(error.mean())
    return MAX_PSNR_DB if mean <= 10 ** (-MAX_PSNR_DB / 10) else -10.0 * math.log10(mean)


def ssim(image: np.ndarray, truth: np.ndarray) -> float:
    """Mean SSIM, 11 x 11 Gaussian window of sigma 1.5, zero padding, per channel, data range 1."""
    clipped = torch.from_numpy(np.ascontiguousarray(np.clip(image, 0.0, 1.0), dtype=np.float32))
    return float(ssim_map(clipped, torch.from_numpy(np.ascontiguousarray(truth, dtype=np.float32))).mean())


def fit_colors(image: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """The image after the gain and offset per channel that fit the truth best. [H, W, 3] float64

    A held-out camera's white balance cannot be known without its pictures; this removes it from the error, and only
    from figures that say so.
    """
    fitted = np.empty(image.shape, np.float64)
    for channel in range(3):
        x, y = (
            image[..., channel].astype(np.float64).ravel(),
            truth[..., channel].astype(np.float64).ravel(),
        )
        variance = float(x.var())
        gain = float(((x - x.mean()) * (y - y.mean())).mean()) / variance if variance > 1e-12 else 1.0
        fitted[..., channel] = gain * (image[..., channel] - x.mean()) + y.mean()
    return fitted
