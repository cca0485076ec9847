"""Which colours are compared: as rendered or rounded to 8 bit, raw or after a colour fit.

Pictures are [H, W, 3] in 0..1.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

Precision = Literal["float", "8bit"]


def as_shown(image: np.ndarray, precision: Precision) -> np.ndarray:
    """The picture as its reader gets it: clamped to 0..1, and rounded to the 256 levels of a PNG file for "8bit".

    Published figures are mostly of 8-bit files; "float" leaves the rounding out of the error. [H, W, 3] float32
    """
    clamped = np.clip(image, 0.0, 1.0).astype(np.float32, copy=False)
    if precision == "float":
        return clamped
    return _rounded(clamped) / np.float32(255.0)


_LEAST_VARIANCE = _LEAST_SLOPE = 1e-8
"""Of the truth, and of what is undone, in `correct_colors`; gsplat's."""


def to_levels(image: np.ndarray) -> np.ndarray:
    """A picture as it is written to a PNG file: clamped and rounded. [H, W, 3] uint8"""
    return _rounded(np.clip(image, 0.0, 1.0)).astype(np.uint8)


def _rounded(clamped: np.ndarray) -> np.ndarray:
    """Levels 0 to 255, still as numbers, so that what is not finite stays so."""
    return np.floor(clamped * np.float32(255.0) + np.float32(0.5))


def fit_colors(image: np.ndarray, truth: np.ndarray, mask: np.ndarray | None = None) -> np.ndarray:
    """The image after the gain and offset per channel that fit the truth best, least squares. [H, W, 3] float64

    A held-out camera's white balance cannot be known without its pictures; this removes it from the error, and only
    from figures that say so. A channel of one colour only gets an offset. Not rounded and not clamped.

    Args:
        mask: Pixels that the fit is made from, at least one; None for all. [H, W] bool
    """
    fitted = np.empty(image.shape, np.float64)
    for channel in range(3):
        x = image[..., channel].astype(np.float64)
        y = truth[..., channel].astype(np.float64)
        own, other = (x, y) if mask is None else (x[mask], y[mask])
        x_mean, y_mean = own.mean(), other.mean()
        own = own - x_mean
        variance = float((own * own).mean())
        gain = float((own * (other - y_mean)).mean()) / variance if variance > 1e-12 else 1.0
        x -= x_mean
        fitted[..., channel] = gain * x + y_mean
    return fitted


def correct_colors(image: np.ndarray, truth: np.ndarray, mask: np.ndarray | None = None) -> np.ndarray:
    """The image as gsplat's affine colour correction makes it before it measures cc_psnr. [H, W, 3] float64 in 0..1

    Per channel a and b are fitted so that a * truth + b comes nearest to the image, least squares, and undone: the
    result is (image - b) / a, clamped. That is not the gain and offset with the least error, so figures of it are
    never better than after `fit_colors`, but for the clamping. Where the truth has one colour, or does not tell the
    image's at all (a below 1e-8), a is 1 and only the offset is undone: nothing is divided by zero.

    Args:
        mask: Pixels that the fit is made from, at least one; None for all. [H, W] bool
    """
    corrected = np.empty(image.shape, np.float64)
    for channel in range(3):
        x = image[..., channel].astype(np.float64)
        y = truth[..., channel].astype(np.float64)
        own, other = (x, y) if mask is None else (x[mask], y[mask])
        x_mean, y_mean = own.mean(), other.mean()
        other = other - y_mean
        slope = float((other * (own - x_mean)).mean()) / max(float((other * other).mean()), _LEAST_VARIANCE)
        slope = slope if abs(slope) >= _LEAST_SLOPE else 1.0
        corrected[..., channel] = np.clip((x - x_mean) / slope + y_mean, 0.0, 1.0)
    return corrected
