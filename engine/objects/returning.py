"""Returning: what has come into the scene, and looks like an object that was there before."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from engine.objects.appearance import Appearance, appearance_of, likeness
from engine.objects.moving_parts import MovingParts

LEAST_BOND = 0.05
"""Weaker bonds do not make one thing of two."""
LEAST_MASS = 0.2
"""Things with less of the object's mass than this share are not it."""
MOST_KNOWN = 0.3
"""A thing of which more was there before is not new."""
LEAST_LIKENESS = 0.6


@dataclass(frozen=True, slots=True, eq=False)
class Returned:
    """What may be the object. is_in: Which parts of the clip. [N] bool; likeness: 0..1"""

    is_in: np.ndarray
    likeness: float


def returned(parts: MovingParts, bonds: csr_matrix, surety: np.ndarray, known_as: Appearance) -> Returned | None:
    """The thing in a clip that was not there before and looks most like the object; None where nothing does.

    Args:
        bonds: Between the parts. [N, N]
        surety: How surely something lay in the place of each part in the clip before; 0 for those that are not there
            at the border. [N]
        known_as: The object.
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
        found = appearance_of(parts, is_in.astype(np.float64))
        alike = likeness(known_as, found) if found.mass > LEAST_MASS * known_as.mass else 0.0
        if alike > LEAST_LIKENESS and (best is None or alike > best.likeness):
            best = Returned(is_in, alike)
    return best
