"""The density of a cloud of points."""

from __future__ import annotations

import numpy as np

SPACING_SAMPLE = 2000
"""Points that are asked for their nearest neighbour to learn how dense a cloud is."""


def point_spacing(points: np.ndarray) -> float:
    """Usual distance from a point to its nearest neighbour, from a sample of them; 0 for fewer than two points."""
    if len(points) < 2:
        return 0.0
    from scipy.spatial import KDTree  # the window's first picture does not wait for it

    sample = points[:: max(len(points) // SPACING_SAMPLE, 1)]
    distances, _ = KDTree(points).query(sample, k=2)
    return float(np.median(distances[:, 1]))
