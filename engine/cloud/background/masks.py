"""Motion masks: where a picture differs from its camera's background. Floor shadows count as moving on purpose.

Not a segmentation of objects; no learning. All sizes follow the image width, so scaling a capture scales its masks.
"""

from __future__ import annotations

import numpy as np

from engine.images.image_filters import blurred_difference, dilate, erode, remove_small_blobs

REFERENCE_WIDTH = 640.0
"""Sizes below are pixels at this width (chosen on 640 x 360 pictures of a dome)."""
MIN_THRESHOLD = 20.0
"""Sum of RGB levels; below this even a noiseless camera shows compression and rounding."""
NOISE_FACTOR = 5.0
"""Threshold in medians of the difference picture; most of a picture is static, so its median measures noise."""


def motion_mask(
    frame: np.ndarray,
    background: np.ndarray,
    *,
    threshold: float | None = None,
    is_valid: np.ndarray | None = None,
) -> np.ndarray:
    """Pixels that differ from the background.

    Args:
        frame: [H, W, 3] uint8
        background: [H, W, 3] uint8 or float 0..255.
        threshold: Sum over RGB of the blurred difference that counts as motion, 0..765. None derives it from the
            picture's own noise: NOISE_FACTOR x the median difference, at least MIN_THRESHOLD.
        is_valid: Pixels that the camera sees, None for all: the others, black in both pictures, never move. [H, W] bool
    Returns:
        [H, W] bool.
    """
    scale = frame.shape[1] / REFERENCE_WIDTH
    difference = blurred_difference(frame, background, sigma_px=max(0.6, scale))
    if threshold is None:
        threshold = noise_threshold(difference, is_valid)
    mask = difference > threshold
    open_px = round(scale)
    mask = dilate(erode(mask, open_px), open_px)
    close_px = max(1, round(4 * scale))
    mask = erode(dilate(mask, close_px), close_px)
    if is_valid is not None:
        mask &= is_valid
    return remove_small_blobs(mask, max(6, round(60 * scale * scale)))


def noise_threshold(difference: np.ndarray, is_valid: np.ndarray | None = None) -> float:
    """Threshold for a blurred difference picture [H, W] from its median, robust while under half of it moves.

    Args:
        is_valid: Pixels of which the median is taken; None for all. [H, W] bool
    """
    sampled = difference[::2, ::2] if is_valid is None else difference[::2, ::2][is_valid[::2, ::2]]
    return max(MIN_THRESHOLD, NOISE_FACTOR * float(np.median(sampled))) if sampled.size else MIN_THRESHOLD
