"""Belonging: how far each part of a clip belongs to an object, from what is known of some and the bonds between all.

A random walker's potential (Grady, "Random Walks for Image Segmentation", 2006): the smallest sum of squared
differences over bonds and from what is known. Soft, so that it also says where it is unsure.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import cg

BOND = 6.0
"""Weight of a whole bond against a thing that is known for sure."""
NOWHERE = 1e-4
"""Pull toward not belonging, for parts without any bond to what is known."""
MAX_ROUNDS = 300


def belonging(bonds: csr_matrix, said: np.ndarray, weight: np.ndarray, begin: np.ndarray | None = None) -> np.ndarray:
    """How far each part belongs to the object, 0..1. [N]

    Args:
        bonds: Symmetric strengths. [N, N]
        said: What is known of each part, 0..1. [N]
        weight: How surely; 0 where nothing is. [N]
        begin: A guess to begin with.
    """
    if not len(said):
        return np.zeros(0)
    pull = np.asarray(weight, np.float64) + NOWHERE
    degree = BOND * np.asarray(bonds.sum(1)).reshape(-1)
    matrix = (diags(degree + pull) - BOND * bonds).tocsr()
    scale = diags(1.0 / (degree + pull))
    result, _ = cg(matrix, weight * said, x0=begin, M=scale, rtol=1e-4, maxiter=MAX_ROUNDS)
    return np.clip(result, 0.0, 1.0)
