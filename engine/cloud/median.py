"""Median over cameras of what each of them saw of a point. One compiled kernel; knows nothing of colours."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
def median_over_cameras(samples):
    """Median over the first axis, of the finite values only.

    Args:
        samples: One row per camera, not finite where it saw nothing. [C, P, 3]
    Returns:
        [P, 3] of the same type; NaN where no camera saw the point.
    """
    n_cameras, n_points, n_channels = samples.shape
    medians = np.full((n_points, n_channels), np.nan, samples.dtype)
    ranked = np.empty(n_cameras, samples.dtype)
    for p in range(n_points):
        for channel in range(n_channels):
            n = 0
            for camera in range(n_cameras):
                value = samples[camera, p, channel]
                if np.isfinite(value):
                    j = n
                    while j > 0 and ranked[j - 1] > value:
                        ranked[j] = ranked[j - 1]
                        j -= 1
                    ranked[j] = value
                    n += 1
            if n > 0:
                medians[p, channel] = 0.5 * (ranked[(n - 1) // 2] + ranked[n // 2])
    return medians
