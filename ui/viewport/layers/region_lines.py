"""Regions as wire: spheres and boxes, whole lines for static ones and dashes for those where everything may change.

What lies behind the middle of a region is drawn fainter, so that a sphere looks round. No GL.
"""

from __future__ import annotations

import numpy as np

from engine.gate.regions import GateRegion
from ui.style.colors import REGION_COLORS

N_SEGMENTS, N_EDGE_SEGMENTS = 64, 24
"""Of a circle, and of an edge of a box."""
N_SMALL_DASH, N_LARGE_DASH = 4, 2
"""Segments of a dash, and of the gap after it, for regions that look small and for large ones."""
LARGE_SHARE = 0.1
"""Regions larger than this share of their distance look large."""
BACK_ALPHA = 0.35


def region_lines(region: GateRegion, eye: np.ndarray, *, is_fine: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Line segments of a region as seen from somewhere.

    Args:
        eye: Scene units. [3]
        is_fine: More circles on a sphere.
    Returns:
        vertices: Two per line. [2 L, 3] float32
        colors: RGBA. [2 L, 4] float32
    """
    paths = _circles(region, is_fine=is_fine) if region.radius > 0.0 else _edges(region)
    segments = np.stack([paths[:, :-1], paths[:, 1:]], axis=2)  # [paths, segments, 2, 3]
    center = np.array(region.center)
    if region.treat == "dynamic":
        size = 0.5 * float(np.min(np.array(region.high) - np.array(region.low)))
        is_large = size > LARGE_SHARE * float(np.linalg.norm(np.asarray(eye) - center))
        n = N_LARGE_DASH if is_large else N_SMALL_DASH
        segments = segments[:, np.arange(segments.shape[1]) % (2 * n) < n]
    vertices = segments.reshape(-1, 3)
    is_behind = ((vertices - center) * (np.asarray(eye) - center)).sum(axis=1) < 0.0
    colors = np.tile(np.array(REGION_COLORS[region.treat], np.float32), (len(vertices), 1))
    colors[is_behind, 3] *= BACK_ALPHA
    return vertices.astype(np.float32), colors


def _circles(region: GateRegion, *, is_fine: bool) -> np.ndarray:
    """Three great circles, with is_fine also two parallels. [circles, N_SEGMENTS + 1, 3]"""
    angles = np.linspace(0.0, 2.0 * np.pi, N_SEGMENTS + 1)
    cos, sin = np.cos(angles)[:, None], np.sin(angles)[:, None]
    x, y, z = np.eye(3)
    circles = [cos * x + sin * y, cos * y + sin * z, cos * z + sin * x]
    if is_fine:
        half = np.sqrt(0.5)
        circles += [half * (cos * x + sin * z + side * y) for side in (-1.0, 1.0)]
    return np.array(region.center) + region.radius * np.stack(circles)


def _edges(region: GateRegion) -> np.ndarray:
    """The twelve edges of a box. [12, N_EDGE_SEGMENTS + 1, 3]"""
    low, high = np.array(region.low), np.array(region.high)
    shares = np.linspace(0.0, 1.0, N_EDGE_SEGMENTS + 1)
    edges = []
    for axis in range(3):
        others = [other for other in range(3) if other != axis]
        for first in (0.0, 1.0):
            for second in (0.0, 1.0):
                unit = np.zeros((N_EDGE_SEGMENTS + 1, 3))
                unit[:, axis], unit[:, others[0]], unit[:, others[1]] = shares, first, second
                edges.append(low + unit * (high - low))
    return np.stack(edges)
