"""Per-camera white balance: camera_colour = gain * scene_colour, one gain per channel.

Not a full colour model: there is no offset and there are no cross terms, as they gain nothing. The gauge is a median
of 1 over the cameras, so scene colours are those of the median camera, and an unseen camera is shown in them. The
median, because real rigs hold a crowd of similar cameras and a few far off. Training puts its gains back into this
gauge after every step, since what is unseen is shown at gain 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.cloud.median import median_over_cameras

N_ROUNDS = 8
"""Alternations of the two medians; changes are below 1e-3 after about five."""
MIN_OBSERVATIONS = 50
"""A camera that sees fewer points keeps the gain it came with."""
MIN_SPREAD = 0.01
"""A smaller spread over the cameras is left alone: uncorrected it alone would cost 46 dB, renders reach 30 to 40."""
MIN_SPREAD_RATIO = 2.0
"""Cameras differ when the spread is this many times its own uncertainty; with equal cameras the ratio is about 1."""
MAX_SPLIT_POINTS = 6000
"""Points used for the uncertainty, evenly chosen; more would make it no better, because wrong depths dominate."""


@dataclass(frozen=True, slots=True)
class GainSpread:
    """How far the gains of the cameras lie apart, and how well they are known.

    Attributes:
        spread: RMS over cameras and channels of the log gain against the camera mean; 0.1 is about 10 %.
        uncertainty: RMS error of such a log gain, from the two sides of the scene; infinite if nothing tells it.
        n_cameras: Cameras that see enough points on both sides.
    """

    spread: float
    uncertainty: float
    n_cameras: int

    @property
    def is_real(self) -> bool:
        """Whether the cameras differ by more than the estimate errs."""
        return self.spread > max(MIN_SPREAD, MIN_SPREAD_RATIO * self.uncertainty)


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
        gains float64 [C, 3] with median 1 over the cameras; colours [P, 3] 0..255, NaN where no camera sees the point.
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
        log_gains -= np.median(log_gains, axis=0)
    return np.exp(log_gains), scene_colors(log_colors, np.exp(log_gains))


def in_gauge(gains: np.ndarray) -> np.ndarray:
    """The gains with a median of 1 over the cameras, channel by channel; of an even number, the mean of both in log.

    Args:
        gains: Above 0. [C, 3] float
    Returns:
        [C, 3], dtype of gains. Ratios between cameras stay.
    """
    return (gains / np.exp(np.median(np.log(np.maximum(gains.astype(np.float64), 1e-6)), axis=0))).astype(gains.dtype)


def scene_colors(log_colors: np.ndarray, gains: np.ndarray) -> np.ndarray:
    """Median over the cameras of what they saw, without their gains.

    Args:
        log_colors: As in gains_from_observations. [C, P, 3]
        gains: [C, 3]
    Returns:
        [P, 3] 0..255, NaN where no camera sees the point.
    """
    observations = log_colors - np.log(gains)[:, None].astype(log_colors.dtype)
    return np.exp(median_over_cameras(np.ascontiguousarray(observations))) - 1.0


def gain_spread(points: np.ndarray, log_colors: np.ndarray) -> GainSpread:
    """Spread of the gains against their uncertainty, from the two sides of the scene.

    The scene is cut in the middle across each of its principal axes. Both sides of a cut give gains of their own, and
    what differs between them is error: noise, but also wrong depths and shading that depends on the view, which random
    halves would share. Both start at equal cameras: medians that start elsewhere may stay there together.

    Args:
        points: [P, 3]
        log_colors: As in gains_from_observations. [C, P, 3]
    """
    step = -(-len(points) // MAX_SPLIT_POINTS) if len(points) else 1
    points, log_colors = points[::step], log_colors[:, ::step]
    is_seen = np.isfinite(log_colors[..., 0])
    centered = points - points.mean(0) if len(points) else points
    axes = np.linalg.eigh(centered.T @ centered)[1].T
    squared_spreads, squared_errors, n_cameras = [], [], []
    for axis in axes:
        along = centered @ axis
        is_low = along < np.median(along) if len(along) else np.zeros(0, bool)
        sides = [is_low, ~is_low]
        is_measured = np.all([(is_seen & side).sum(1) >= MIN_OBSERVATIONS for side in sides], axis=0)
        if is_measured.sum() < 2:
            continue
        logs = []
        for side in sides:
            gains, _ = gains_from_observations(log_colors[is_measured][:, side], np.ones((is_measured.sum(), 3)))
            logs.append(np.log(gains) - np.log(gains).mean(0))
        n_free = is_measured.sum() / (is_measured.sum() - 1)  # the mean over the cameras was taken from them
        squared_spreads.append(n_free * np.mean(((logs[0] + logs[1]) / 2) ** 2))
        squared_errors.append(n_free * np.mean(((logs[0] - logs[1]) / 2) ** 2))
        n_cameras.append(int(is_measured.sum()))
    if not n_cameras:
        return GainSpread(0.0, float("inf"), 0)
    return GainSpread(float(np.sqrt(np.mean(squared_spreads))), float(np.sqrt(np.mean(squared_errors))), min(n_cameras))
