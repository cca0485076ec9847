"""How a camera's exposure changes over time: a gain per channel and picture, from pixels that stand still.

Most of a picture shows the same surfaces as a still picture of the same camera, a person or a shadow does not. The
ratio that most pixels share is the camera's gain: the densest ratio is found first, whatever else there is, and refined
from the ratios near it. Only pixels that are neither dark nor white count. Changes too small
to be distinguished from noise are dropped, so that a camera that does not change is left alone.

Not a light model: what changes in all cameras alike, such as daylight, looks like their exposure, and counts
as that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from engine.images.exposure_curve import to_reference

WORKING_WIDTH_PX = 160
"""Pictures are thinned out to about this width: as many pixels as a gain needs."""
DARKEST, BRIGHTEST = 16.0, 235.0
"""Grey levels between which a ratio means a gain: below, an offset and rounding weigh in, above, white is cut off."""
MIN_PIXELS = 200
"""With fewer usable ones nothing is said: no change."""
LARGEST_LOG_GAIN = 0.7
"""Larger ratios come from other things than the exposure of a camera within one take: a factor of two."""
N_BINS = 140
"""Of the histogram in which the densest ratio is looked for: a hundredth wide."""
REACH = 0.06
"""Ratios further from the gain than that say nothing of it, log: biweight of Tukey."""
N_ROUNDS = 5
NO_CHANGE = 0.0015
"""Log gains up to this count as unchanged, those from twice this on count in full, and nothing jumps in between. Frames
of a real capture scatter by 0.0004."""


@dataclass(frozen=True, slots=True)
class Exposure:
    """One camera's exposure in the reference clip, by which its other pictures are found brighter or darker.

    Attributes:
        look: Its picture while nothing moves, at working size, 0 to 255. [h, w, 3] float32
        gain: Of the look against the exposure that is meant. [3] float64
    """

    look: np.ndarray
    gain: np.ndarray

    @classmethod
    def of_frames(cls, frames: np.ndarray) -> Exposure:
        """The mean exposure of some frames, those of a reference clip. [T, H, W, 3] uint8"""
        small = [at_working_size(frame) for frame in frames]
        look = np.median(np.stack(small), axis=0).astype(np.float32)
        gains = [gain_of(picture, look) for picture in small]
        return cls(look, np.exp(-np.log(gains).mean(0)))

    @classmethod
    def of_background(cls, background: np.ndarray) -> Exposure:
        """The exposure that a background is in. [H, W, 3] uint8"""
        return cls(at_working_size(background), np.ones(3))

    def gains_of(self, frames: np.ndarray) -> np.ndarray:
        """Gain of each frame against this exposure; exactly 1 where it cannot be distinguished from 1. [T, 3] float32

        Args:
            frames: Of the same camera. [T, H, W, 3] uint8
        """
        gains = [gain_of(at_working_size(frame), self.look) * self.gain for frame in frames]
        return without_noise(np.stack(gains)).astype(np.float32)

    def applied_to(self, frames: np.ndarray) -> np.ndarray:
        """Frames of the same camera, each brought into this exposure. [T, H, W, 3] uint8"""
        gains = self.gains_of(frames)
        if (gains == 1.0).all():
            return frames
        return np.stack([to_reference(frame, gain) for frame, gain in zip(frames, gains, strict=True)])


def at_working_size(picture: np.ndarray) -> np.ndarray:
    """Every n-th pixel both ways, each the mean of two by two. [H, W, 3] uint8 to [h, w, 3] float32"""
    step = max(1, picture.shape[1] // WORKING_WIDTH_PX)
    if step == 1:
        return picture.astype(np.float32)
    height, width = picture.shape[0] // step * step, picture.shape[1] // step * step
    first, other = picture[:height:step, :width:step], picture[1:height:step, :width:step]
    right, diagonal = picture[:height:step, 1:width:step], picture[1:height:step, 1:width:step]
    return (first.astype(np.uint16) + other + right + diagonal).astype(np.float32) / np.float32(4.0)


def gain_of(picture: np.ndarray, look: np.ndarray) -> np.ndarray:
    """Gain of one picture against a still look of the same camera.

    Args:
        picture, look: At working size, 0 to 255. [h, w, 3] float32
    Returns:
        Above 0. [3] float64; ones where too few pixels can tell.
    """
    ratios = np.empty((look.shape[0] * look.shape[1], 3), np.float32)
    counts = np.empty((3, N_BINS + 2), np.int64)
    logs = np.empty(3)
    _log_gain(picture, look, ratios, counts, logs)
    return np.exp(logs)


@njit(cache=True, nogil=True, error_model="numpy")
def _log_gain(picture, look, ratios, counts, logs):
    """Writes the gain's logs. Scratch: ratios [h * w, 3], counts [3, N_BINS + 2] with an empty bin at either end."""
    height, width, _ = look.shape
    counts[:] = 0
    n = 0
    for y in range(height):
        for x in range(width):
            is_usable = True
            for c in range(3):
                seen, still = picture[y, x, c], look[y, x, c]
                if not (DARKEST < seen < BRIGHTEST and DARKEST < still < BRIGHTEST):
                    is_usable = False
                    break
                ratio = np.log(seen / still)
                if not abs(ratio) < LARGEST_LOG_GAIN:
                    is_usable = False
                    break
                ratios[n, c] = ratio
            if is_usable:
                for c in range(3):
                    counts[c, 1 + int((ratios[n, c] + LARGEST_LOG_GAIN) / (2 * LARGEST_LOG_GAIN) * N_BINS)] += 1
                n += 1
    logs[:] = 0.0
    if n < MIN_PIXELS:
        return
    for c in range(3):  # the middle of the fullest stretch of three bins
        most = -1
        for i in range(1, N_BINS + 1):
            count = counts[c, i - 1] + counts[c, i] + counts[c, i + 1]
            if count > most:
                most = count
                logs[c] = (i - 0.5) / N_BINS * 2 * LARGEST_LOG_GAIN - LARGEST_LOG_GAIN
    sums = np.empty(3)
    for _ in range(N_ROUNDS):
        sums[:] = 0.0
        total = 0.0
        for i in range(n):
            weight = 1.0
            for c in range(3):
                off = (ratios[i, c] - logs[c]) / REACH
                weight = min(weight, max(1.0 - off * off, 0.0) ** 2)
            total += weight
            for c in range(3):
                sums[c] += weight * ratios[i, c]
        if total < 0.01 * MIN_PIXELS:  # the channels' peaks belong to different pixels
            logs[:] = 0.0
            return
        for c in range(3):
            logs[c] = sums[c] / total


def without_noise(gains: np.ndarray) -> np.ndarray:
    """Gains whose smallest changes are none, see NO_CHANGE: of the same dtype, exactly 1 where nothing changes."""
    return np.exp(without_smallest(np.log(gains.astype(np.float64)), NO_CHANGE)).astype(gains.dtype)


def without_smallest(logs: np.ndarray, limit: float) -> np.ndarray:
    """Firm shrinkage: values up to a limit become 0, from twice the limit on they stay, nothing jumps in between."""
    size = np.abs(logs)
    return np.sign(logs) * np.clip(2.0 * (size - limit), 0.0, size)
