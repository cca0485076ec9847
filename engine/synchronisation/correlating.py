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
    energies = [np.concatenate([[0.0], np.cumsum((signal**2).sum(axis=1))]) for signal in (first, second)]
    low, high = np.maximum(0, -lags), np.minimum(n_first, n_second - lags)
    powers = (energies[0][high] - energies[0][low]) * (energies[1][high + lags] - energies[1][low + lags])
    return lags, products / np.sqrt(np.maximum(powers, 1e-20))
