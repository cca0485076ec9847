"""Median over cameras of what each of them saw of a point. One compiled kernel; knows nothing of colours.

Kernels of this package take their buffers and results as arguments: each shape and type that a kernel makes an array of
costs as much compiling as a small kernel.
"""

from __future__ import annotations

import numpy as np
from numba import njit


def median_over_cameras(samples: np.ndarray) -> np.ndarray:
    """Median over the first axis, of the finite values only.

    Args:
        samples: One row per camera, not finite where it saw nothing. [C, P, 3] float32 or float64
    Returns:
        [P, 3] of the same type; NaN where no camera saw the point.
    """
    medians = np.full(samples.shape[1:], np.nan)
    # in float64 alone, so that it is compiled once: a mean of two float32 rounds to the same float32 from there
    _rank(np.ascontiguousarray(samples, dtype=np.float64), np.empty(len(samples)), medians)
    return medians.astype(samples.dtype, copy=False)


@njit(cache=True, nogil=True, error_model="numpy")
def _rank(samples, ranked, medians):
    n_cameras, n_points, n_channels = samples.shape
    for p in range(n_points):
        for channel in range(n_channels):
            n = 0
            for camera in range(n_cameras):
                value = samples[camera, p, channel]
                if value - value == 0.0:  # finite
                    j = n
                    while j > 0 and ranked[j - 1] > value:
                        ranked[j] = ranked[j - 1]
                        j -= 1
                    ranked[j] = value
                    n += 1
            if n > 0:
                medians[p, channel] = 0.5 * (ranked[(n - 1) // 2] + ranked[n // 2])
