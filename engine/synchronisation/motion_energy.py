"""Offsets by how much moves when, without calibration: events such as a start, a turn or a jump show in all views.

Views differ, so single pairs are often wrong; all pairs together usually are not. No use where everything moves evenly.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from engine.synchronisation.correlating import PairCurve, correlate, overlaps
from engine.synchronisation.motion_pictures import MotionPictures

SLOW_S = 1.0
"""Changes slower than this depend on the view more than on the event."""


def motion_curves(
    motions: Sequence[MotionPictures], starts_frames: Sequence[float], fps: float, max_lag: int
) -> list[PairCurve]:
    """The agreement of all pairs for every offset between them. Arguments as of `epipolar_curves`."""
    signals = [_signal(motion, fps) for motion in motions]
    curves = []
    for first, one in enumerate(signals):
        for second in range(first + 1, len(signals)):
            other = signals[second]
            if one.any() and other.any():
                lags, scores = correlate(one, other, max_lag)
                offsets = lags + starts_frames[second] - starts_frames[first]
                curves.append(PairCurve(first, second, offsets, scores, overlaps(len(one), len(other), lags)))
    return curves


def _signal(motion: MotionPictures, fps: float) -> np.ndarray:
    """To compare: how much changes, how much is there, and how high in the picture, without slow parts. [T, 3]"""
    width, height = motion.size
    rows = np.repeat(np.arange(height), width)
    changes, presence = (np.asarray(part.sum(axis=1)).ravel() for part in (motion.changes, motion.presence))
    heights = np.asarray(motion.changes @ rows).ravel() / np.maximum(changes, 1e-6)
    is_moving = changes > 1e-4 * width * height
    if is_moving.sum() < 3:
        return np.zeros((len(changes), 3))
    times = np.arange(len(changes))
    heights = np.interp(times, times[is_moving], heights[is_moving])
    signals = np.stack([np.log(changes + 1e-3 * width * height), np.log(presence + 1e-3 * width * height), heights], 1)
    signals = ndimage.gaussian_filter1d(signals, 0.7, axis=0)
    signals -= ndimage.gaussian_filter1d(signals, SLOW_S * fps / 2, axis=0)
    return signals / np.maximum(signals.std(axis=0), 1e-9)
