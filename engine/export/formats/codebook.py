"""256 numbers that stand for many: k-means along a line, on a histogram, so that it costs the same for any number."""

from __future__ import annotations

import numpy as np

SIZE = 256
_BINS = 1 << 14
_ROUNDS = 4


def codebook(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The 256 numbers that stand for all with about the smallest squared error, rising, and the nearest one of each.

    Args:
        values: Finite. Any shape.
    Returns:
        [256] float64; the shape of `values`, uint8.
    """
    flat = np.asarray(values, np.float64).ravel()
    known = np.unique(flat[:: max(1, len(flat) // 4096)])
    if len(known) <= SIZE and np.isin(flat, known).all():  # few different ones: exactly these
        centers = np.pad(known, (0, SIZE - len(known)), mode="edge") if len(known) else np.zeros(SIZE)
    else:
        centers = _means_along_line(flat)
    borders = (centers[1:] + centers[:-1]) / 2.0
    return centers, np.searchsorted(borders, flat, side="left").astype(np.uint8).reshape(np.shape(values))


def _means_along_line(flat: np.ndarray) -> np.ndarray:
    counts, edges = np.histogram(flat, _BINS)
    middles = (edges[1:] + edges[:-1]) / 2.0
    # half of the codes where many numbers are, as the cube root of their density, which is the best there is for many
    # codes; half of them evenly, so that the few largest Gaussians keep their size
    dense = np.cbrt(counts)
    share = np.cumsum(dense / dense.sum() + 1.0 / _BINS)
    centers = np.interp((np.arange(SIZE) + 0.5) / SIZE * share[-1], share, middles)
    n_below = np.concatenate([[0.0], np.cumsum(counts)])
    sum_below = np.concatenate([[0.0], np.cumsum(counts * middles)])
    for _ in range(_ROUNDS):
        borders = np.searchsorted(middles, (centers[1:] + centers[:-1]) / 2.0)
        cuts = np.concatenate([[0], borders, [_BINS]])
        n = np.diff(n_below[cuts])
        centers = np.sort(np.where(n > 0.0, np.diff(sum_below[cuts]) / np.maximum(n, 1.0), centers))
        centers[0], centers[-1] = edges[0], edges[-1]
    return centers
