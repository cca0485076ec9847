"""Small image filters on numpy arrays: block means, Gaussian blur, binary morphology, blob removal.

Not a general image library: just what backgrounds, masks and depth maps need, without OpenCV. All kernels release
the GIL and are single threaded; callers spread cameras over threads.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy import ndimage

from engine.kernels.fast_math import ALL, fast_math


def block_mean(image: np.ndarray, factor: int) -> np.ndarray:
    """Shrink by an integer factor with box averages; a remainder at the right and lower border is cut off.

    With pixel centres at +0.5 the intrinsics of the result are exactly K / factor.

    Args:
        image: [H, W] or [H, W, channels], any real type.
    Returns:
        float32 [H // factor, W // factor(, channels)].
    """
    height, width = image.shape[0] // factor, image.shape[1] // factor
    cut = image[: height * factor, : width * factor]
    blocks = cut.reshape(height, factor, width, factor, *image.shape[2:])
    return blocks.mean(axis=(1, 3), dtype=np.float32)


def gaussian_taps(sigma_px: float) -> np.ndarray:
    """Normalised symmetric weights out to three sigma. float32 [2 r + 1]"""
    radius = max(1, int(np.ceil(3.0 * sigma_px)))
    offsets = np.arange(-radius, radius + 1)
    taps = np.exp(-0.5 * (offsets / max(sigma_px, 1e-3)) ** 2)
    return (taps / taps.sum()).astype(np.float32)


def blurred_difference(frame: np.ndarray, background: np.ndarray, sigma_px: float) -> np.ndarray:
    """Sum over RGB of |blur(frame - background)|. Blurring first lets sensor noise cancel and keeps real change.

    Args:
        frame: [H, W, 3] uint8
        background: [H, W, 3] uint8 or float, same scale 0..255.
    Returns:
        float32 [H, W] in 0..765.
    """
    height, width, n_channels = frame.shape
    reference, taps = np.ascontiguousarray(background, dtype=np.float32), gaussian_taps(sigma_px)
    rows = np.empty((height, width * n_channels), np.float32)
    line = np.empty((width + len(taps) - 1) * n_channels, np.float32)
    total = np.empty((height, width), np.float32)
    _blurred_difference(np.ascontiguousarray(frame), reference, taps, rows, line, total)
    return total


def dilate(mask: np.ndarray, radius_px: int) -> np.ndarray:
    """Grow by a square of half width radius_px. bool [H, W]"""
    if radius_px < 1:
        return mask.copy()
    rows, grown = np.zeros((2, *mask.shape), dtype=bool)
    _window_any(np.ascontiguousarray(mask), radius_px, rows, grown)
    return grown


def erode(mask: np.ndarray, radius_px: int) -> np.ndarray:
    """Shrink by a square of half width radius_px; outside the picture counts as set, so borders are not eaten."""
    return ~dilate(~mask, radius_px)


def remove_small_blobs(mask: np.ndarray, min_px: int) -> np.ndarray:
    """Drop 8-connected components with fewer than min_px pixels. bool [H, W]"""
    labels = np.zeros(mask.shape, dtype=np.int32)
    ndimage.label(mask, structure=np.ones((3, 3), dtype=np.int8), output=labels)
    is_kept: np.ndarray = np.bincount(labels.ravel()) >= min_px
    is_kept[0] = False
    return is_kept[labels]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=fast_math(*ALL))
def _blurred_difference(frame, background, taps, rows, line, total):
    """Writes total [H, W]. rows [H, 3 W] is scratch, so is line, of one row with what the taps reach on both sides."""
    height, width, n_channels = frame.shape
    radius = len(taps) // 2
    for y in range(height):
        for i in range(width + 2 * radius):
            x = min(max(i - radius, 0), width - 1)
            for c in range(n_channels):
                line[i * n_channels + c] = np.float32(frame[y, x, c]) - background[y, x, c]
        for j in range(width * n_channels):
            rows[y, j] = np.float32(0)
        for k in range(len(taps)):
            tap, shift = taps[k], k * n_channels
            for j in range(width * n_channels):
                rows[y, j] += tap * line[j + shift]
    for y in range(height):
        for j in range(width * n_channels):
            line[j] = np.float32(0)
        for k in range(len(taps)):
            tap, source = taps[k], min(max(y + k - radius, 0), height - 1)
            for j in range(width * n_channels):
                line[j] += tap * rows[source, j]
        for x in range(width):
            value = np.float32(0)
            for c in range(n_channels):
                value += abs(line[x * n_channels + c])
            total[y, x] = value


@njit(cache=True, nogil=True, error_model="numpy")
def _window_any(mask, radius, rows, grown):
    """Sets grown [H, W], which is False before. rows [H, W] is scratch."""
    height, width = mask.shape
    for y in range(height):
        reach = -1  # last column that a set pixel already seen covers
        for x in range(min(radius, width)):
            if mask[y, x]:
                reach = x + radius
        for x in range(width):
            if x + radius < width and mask[y, x + radius]:
                reach = x + 2 * radius
            rows[y, x] = x <= reach
    for y in range(height):
        for source in range(max(0, y - radius), min(height, y + radius + 1)):
            for x in range(width):
                grown[y, x] |= rows[source, x]
