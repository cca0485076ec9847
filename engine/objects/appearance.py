"""How things look: their colours, as shares, and how much of them there is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from engine.objects.moving_parts import MovingParts

N_BINS = 16
"""Of each colour channel; a neighbouring bin is nearly the same colour."""
BLUR = 1.0
"""Bins."""
MASS_SPREAD = 0.8
"""Difference of the logarithms of masses at which the likeness is at 0.6."""
RARE = 1e-4
"""Share of a colour that says nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class Appearance:
    """How a thing looks. colors: Shares of its mass by colour, adding up to 1. [bins]; mass: In its best frame."""

    colors: np.ndarray
    mass: float


def appearance_of(parts: MovingParts, values: np.ndarray) -> Appearance:
    """How the parts look that belong to something. values: How far each does, 0..1. [N]"""
    mass = (parts.opacities * parts.sizes**2) * values
    found = np.bincount(_codes(parts), mass.mean(0), minlength=N_BINS**3).reshape(N_BINS, N_BINS, N_BINS)
    blurred = gaussian_filter(found, BLUR, mode="nearest").reshape(-1)
    return Appearance(blurred / max(blurred.sum(), 1e-30), float(mass.sum(1).max(initial=0.0)))


def likeness(a: Appearance, b: Appearance) -> float:
    """How alike two things look, 0..1: the Bhattacharyya coefficient of their colours, less for another size."""
    if a.mass <= 0 or b.mass <= 0:
        return 0.0
    size = np.exp(-0.5 * (np.log(a.mass / b.mass) / MASS_SPREAD) ** 2)
    return float(np.sqrt(a.colors * b.colors).sum() * size)


def looks_like(parts: MovingParts, one: Appearance, others: Appearance) -> np.ndarray:
    """How far the colour of each part is that of one thing rather than of others, 0..1; 0.5 says nothing. [N]"""
    codes = _codes(parts)
    inside, outside = one.colors[codes] + RARE, others.colors[codes] + RARE
    return inside / (inside + outside)


def _codes(parts: MovingParts) -> np.ndarray:
    return np.clip((parts.colors * N_BINS).astype(int), 0, N_BINS - 1) @ np.array([N_BINS**2, N_BINS, 1])
