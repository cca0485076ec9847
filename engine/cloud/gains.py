"""Per-camera white balance: camera_colour = gain * scene_colour, one gain per channel.

Not a full colour model (no offset, no cross terms). The gauge is fixed by a geometric mean of 1 over the cameras, so
scene colours are those of the mean camera. Measured spread on a real dome: 0.78 to 1.23.
"""

from __future__ import annotations

import numpy as np

from engine.cloud.median import median_over_cameras

N_ROUNDS = 8
"""Alternations of the two medians; changes are below 1e-3 after about five."""
MIN_OBSERVATIONS = 50
"""A camera that sees fewer points keeps the gain it came with."""


def gains_from_pictures(pictures: np.ndarray, is_usable: np.ndarray) -> np.ndarray:
    """First guess: every camera's mean log colour over usable pixels against the mean over cameras.

    Args:
        pictures: 0..255. [C, H, W, 3]
        is_usable: [C, H, W] bool; a camera without usable pixels uses all.
    Returns:
        float64 [C, 3], geometric mean 1.
    """
    logs = np.empty((len(pictures), 3))
    for camera, (picture, usable) in enumerate(zip(pictures, is_usable, strict=True)):
        pixels = picture[usable] if usable.any() else picture.reshape(-1, 3)
        logs[camera] = np.log(pixels.astype(np.float64) + 1.0).mean(0)
    return np.exp(logs - logs.mean(0))


def gains_from_observations(log_colors: np.ndarray, first_guess: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gains and scene colours that explain the same points seen by many cameras, by alternating medians.

    Args:
        log_colors: log(colour + 1) of each point in each camera, NaN where not seen. [C, P, 3]
        first_guess: [C, 3]
    Returns:
        gains float64 [C, 3] with geometric mean 1; colours [P, 3] 0..255, NaN where nobody sees the point.
    """
    log_colors = np.ascontiguousarray(log_colors, dtype=np.float32)
    is_seen = np.isfinite(log_colors[..., 0])
    log_gains = np.log(first_guess)
    is_measured = is_seen.sum(1) >= MIN_OBSERVATIONS
    for _ in range(N_ROUNDS):
        scene = median_over_cameras(log_colors - log_gains[:, None])
        for camera in np.flatnonzero(is_measured):
            rows = is_seen[camera]
            log_gains[camera] = np.median(log_colors[camera, rows] - scene[rows], axis=0)
        log_gains -= log_gains.mean(0)
    return np.exp(log_gains), np.exp(median_over_cameras(log_colors - log_gains[:, None])) - 1.0
