"""A second look at a background with the trained static render, which knows what the other cameras saw.

Someone who stands still for most of a capture is part of one camera's densest mode, but rarely of the multi-view
static scene. Where the two disagree, the frames are asked first: if some of them show what the render shows, their
mean is the true background, sharper than any render; otherwise the render is taken.
"""

from __future__ import annotations

import numpy as np

from engine.images.image_filters import blurred_difference, dilate, erode, remove_small_blobs

REFERENCE_WIDTH = 640.0
STABLE_LIMIT = 60.0
"""Blurred |render - background| (sum of RGB levels) that overrules a stable pixel: well above the error of a render."""
UNSTABLE_LIMIT = 30.0
SUPPORT_LIMIT = 36.0
"""A frame supports the render where their blurred difference is below this."""
MIN_SUPPORT_SHARE = 0.15
REACH_PX = 16.0
"""A stable pixel can only be a ghost this near to unstable ones, at REFERENCE_WIDTH: someone who stands still has a
swaying outline. Everywhere else a difference is the render's own error (lamps, thin things, shine)."""


def recheck_background(
    background: np.ndarray,
    is_stable: np.ndarray,
    static_render: np.ndarray,
    frames: np.ndarray,
    is_valid: np.ndarray | None = None,
) -> np.ndarray:
    """The background with its ghosts replaced.

    Args:
        background: [H, W, 3] uint8
        is_stable: [H, W] bool
        static_render: Trained static scene in this camera's colours, 0..1. [H, W, 3] float
        frames: Some frames of this camera. [T, H, W, 3] uint8
        is_valid: Pixels that the camera sees, None for all; the others stay as they are. [H, W] bool
    Returns:
        [H, W, 3] uint8. Pixels of the render that are not finite change nothing.
    """
    is_asked = np.asarray(np.isfinite(static_render).all(axis=-1))
    is_unstable = ~is_stable
    if is_valid is not None:
        is_asked, is_unstable = is_asked & is_valid, is_unstable & is_valid
    render = np.where(is_asked[..., None], np.clip(static_render, 0.0, 1.0) * 255.0, background).astype(np.float32)
    scale = background.shape[1] / REFERENCE_WIDTH
    sigma_px = max(0.8, 2.0 * scale)
    difference = blurred_difference(background, render, sigma_px)
    is_ghost = difference > np.where(is_stable, STABLE_LIMIT, UNSTABLE_LIMIT)
    is_ghost &= dilate(is_unstable, max(2, round(REACH_PX * scale)))
    radius = max(1, round(scale))
    is_ghost = dilate(erode(is_ghost, radius), radius)  # renders are soft: thin edges always differ
    is_ghost = remove_small_blobs(is_ghost, max(6, round(80 * scale * scale)))
    is_ghost = dilate(is_ghost, max(1, round(3 * scale)))
    if is_valid is not None:
        is_ghost &= is_valid
    if not is_ghost.any():
        return background.copy()
    sums, n_support = np.zeros(render.shape, dtype=np.float32), np.zeros(is_ghost.shape, dtype=np.int64)
    for frame in frames:
        supports = is_ghost & (blurred_difference(frame, render, sigma_px) < SUPPORT_LIMIT)
        sums += frame * supports[..., None]
        n_support += supports
    is_supported = n_support >= max(2, int(np.ceil(MIN_SUPPORT_SHARE * len(frames))))
    means = sums / np.maximum(n_support, 1)[..., None]
    replacement = np.where(is_supported[..., None], means, render)
    return np.where(is_ghost[..., None], np.clip(replacement + 0.5, 0, 255).astype(np.uint8), background)
