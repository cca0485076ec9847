"""How alike two signals over time are for every shift between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

MIN_OVERLAP_FRAMES = 12
MIN_OVERLAP_SHARE = 0.45
"""Of the shorter signal; with less in common, chance makes signals alike."""


@dataclass(frozen=True, eq=False)
class PairCurve:
    """How well two cameras agree for every offset between them.

    Attributes:
        first: Row of one camera.
        second: Row of the other.
        offsets_frames: Offset of the second minus that of the first, rising by 1. [L] float64
        scores: Correlation, -1..1. [L] float64
        overlaps: Share of the shorter signal that is compared. [L] float64
    """

    first: int
    second: int
    offsets_frames: np.ndarray
    scores: np.ndarray
    overlaps: np.ndarray


def overlaps(n_first: int, n_second: int, lags: np.ndarray) -> np.ndarray:
    """Share of the shorter of two signals that is left to compare at these lags. [L] float64"""
    return (np.minimum(n_first, n_second - lags) - np.maximum(0, -lags)) / min(n_first, n_second)


def correlate(first: np.ndarray, second: np.ndarray, max_lag: int) -> tuple[np.ndarray, np.ndarray]:
    """Correlation of two signals of several channels, [T, B] and [U, B], for all shifts with enough in common.

    Returns:
        Lags and correlation: the second signal shifted back by a lag is compared with the first. [L] int64, [L] float64
    """
    first, second = first - first.mean(axis=0), second - second.mean(axis=0)
    n_first, n_second = len(first), len(second)
    enough = max(MIN_OVERLAP_FRAMES, int(MIN_OVERLAP_SHARE * min(n_first, n_second)))
    lags = np.arange(max(-max_lag, enough - n_first), min(max_lag, n_second - enough) + 1)
    if len(lags) == 0:
        return lags, np.zeros(0)
    n = 1 << (n_first + n_second).bit_length()
    spectrum = (np.conj(np.fft.rfft(first, n, axis=0)) * np.fft.rfft(second, n, axis=0)).sum(axis=1)
    products = np.fft.irfft(spectrum, n)[lags]
    low, high = np.maximum(0, -lags), np.minimum(n_first, n_second - lags)
    counts = (high - low).astype(np.float64)
    sums, powers = [], []
    for signal, begin, end in ((first, low, high), (second, low + lags, high + lags)):
        heap = np.concatenate([np.zeros((1, signal.shape[1])), np.cumsum(signal, axis=0)])
        energy = np.concatenate([[0.0], np.cumsum((signal**2).sum(axis=1))])
        part = heap[end] - heap[begin]  # [L, B]
        sums.append(part)
        powers.append(energy[end] - energy[begin] - (part**2).sum(axis=1) / counts)
    # means of what overlaps are taken away, not those of all: signals often rise and fall with the window itself
    shared = products - (sums[0] * sums[1]).sum(axis=1) / counts
    return lags, shared / np.sqrt(np.maximum(powers[0] * powers[1], 1e-20))
