"""Selecting by a number that every Gaussian has: which lie in a range, and how they are spread."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class ValueSpread:
    """How many Gaussians have which value.

    Attributes:
        counts: In bins of equal width; on a logarithmic axis, of equal ratio. [B] int64
        low, high: Smallest and largest value.
        is_log: Whether the bins are of equal ratio.
        n_unknown: Gaussians without a value.
    """

    counts: np.ndarray
    low: float
    high: float
    is_log: bool
    n_unknown: int

    def value_at(self, share: float) -> float:
        """The value at a share of the axis."""
        share = min(max(share, 0.0), 1.0)
        if self.is_log:
            return float(self.low * (self.high / self.low) ** share)
        return float(self.low + share * (self.high - self.low))

    def share_at(self, value: float) -> float:
        """Where on the axis a value lies, 0..1."""
        if self.high <= self.low:
            return 0.0
        if self.is_log:
            share = np.log(max(value, self.low) / self.low) / np.log(self.high / self.low)
        else:
            share = (value - self.low) / (self.high - self.low)
        return float(min(max(share, 0.0), 1.0))


def spread_of(values: np.ndarray, *, n_bins: int = 64, is_log: bool = False) -> ValueSpread | None:
    """How values are spread; None where none is known.

    Args:
        values: NaN where unknown. [N]
        is_log: Bins of equal ratio; values that are not positive then count as unknown.
    """
    values = np.asarray(values, np.float64)
    with np.errstate(invalid="ignore"):
        is_known = np.isfinite(values) & ((values > 0.0) | (not is_log))
    known = values[is_known]
    if len(known) == 0:
        return None
    low, high = float(known.min()), float(known.max())
    places = np.log(known / low) if is_log else known - low
    width = float(places.max())
    bins = np.zeros(len(known), np.int64) if width <= 0.0 else (places / width * n_bins).astype(np.int64)
    counts = np.bincount(np.minimum(bins, n_bins - 1), minlength=n_bins)
    return ValueSpread(counts, low, high, is_log, len(values) - len(known))


def in_range(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Which values lie between two, both included; those that are unknown (NaN) never. [N] bool"""
    with np.errstate(invalid="ignore"):
        return (values >= low) & (values <= high)
