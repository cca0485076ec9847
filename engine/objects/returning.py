"""Returning: what has come into the scene, and looks like an object that was there before."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from engine.objects.moving_parts import MovingParts

N_BINS = 4
"""Of each colour channel."""
LEAST_BOND = 0.05
"""Weaker bonds do not make one thing of two."""
LEAST_MASS = 0.2
"""Things with less of the object's mass than this share are not it."""
MOST_KNOWN = 0.3
"""A thing of which more was there before is not new."""
LEAST_LIKENESS = 0.6
MASS_SPREAD = 0.8
"""Difference of the logarithms of masses at which the likeness is at 0.6."""


@dataclass(frozen=True, slots=True, eq=False)
class Looks:
    """How a thing looks. colors: Shares of its mass by colour, adding up to 1. [bins]; mass: In its best frame."""

    colors: np.ndarray
    mass: float


@dataclass(frozen=True, slots=True, eq=False)
class Returned:
    """What may be the object. is_in: Which parts of the clip. [N] bool; likeness: 0..1"""

    is_in: np.ndarray
    likeness: float


def looks_of(parts: MovingParts, values: np.ndarray) -> Looks:
    """How the parts look that belong to something. values: How far each does, 0..1. [N]"""
    is_in = values > 0.5
    mass = parts.opacities[:, is_in] * parts.sizes[is_in] ** 2
    codes = np.clip((parts.colors[is_in] * N_BINS).astype(int), 0, N_BINS - 1) @ np.array([N_BINS**2, N_BINS, 1])
    found = np.bincount(codes, mass.mean(0), minlength=N_BINS**3)
    return Looks(found / max(found.sum(), 1e-12), float(mass.sum(1).max(initial=0.0)))


def likeness(a: Looks, b: Looks) -> float:
    """How alike two things look, 0..1: the Bhattacharyya coefficient of their colours, less for another size."""
    if a.mass <= 0 or b.mass <= 0:
        return 0.0
    size = np.exp(-0.5 * (np.log(a.mass / b.mass) / MASS_SPREAD) ** 2)
    return float(np.sqrt(a.colors * b.colors).sum() * size)


def returned(parts: MovingParts, bonds: csr_matrix, surety: np.ndarray, looks: Looks) -> Returned | None:
    """The thing in a clip that was not there before and looks most like the object; None where nothing does.

    Args:
        bonds: Between the parts. [N, N]
        surety: How surely something lay in the place of each part in the clip before; 0 for those that are not there
            at the border. [N]
        looks: Of the object.
    """
    if not len(parts):
        return None
    strong = bonds.multiply(bonds > LEAST_BOND)
    n_things, thing = connected_components(strong, directed=False)
    mass = parts.mass
    whole = np.bincount(thing, mass, minlength=n_things)
    known = np.bincount(thing, mass * surety, minlength=n_things) / np.maximum(whole, 1e-12)
    best: Returned | None = None
    for number in np.flatnonzero(known < MOST_KNOWN):
        is_in = thing == number
        found = looks_of(parts, is_in.astype(np.float64))
        alike = likeness(looks, found) if found.mass > LEAST_MASS * looks.mass else 0.0
        if alike > LEAST_LIKENESS and (best is None or alike > best.likeness):
            best = Returned(is_in, alike)
    return best
