"""Which marks lie behind what the picture shows: a coarse map of depths made of the scene's Gaussians. numpy only.

Made for drawing hidden marks fainter, not for measuring: it looks at some of the Gaussians, in cells of many pixels,
and calls a mark hidden only where all cells around it have something in front.
"""

from __future__ import annotations

from collections.abc import Hashable

import numpy as np

from app.playback.modes.arrays import GaussianArrays
from engine.camera.projection import to_camera, to_pixels

MAX_LOOKED_AT = 40_000
CELLS_ACROSS = 72
OPAQUE = 0.4
"""Gaussians fainter than this hide nothing."""
BEHIND = 1.04
"""A mark this many times as far away as what is seen in its place is behind it."""
MIN_KNOWN = 5
"""Of a cell and its eight neighbours, so many have to have something in them."""


class OcclusionMap:
    """Keeps the Gaussians that are looked at, chosen once for each set of them."""

    def __init__(self) -> None:
        self._key: Hashable = None
        self._means = np.zeros((0, 3), np.float32)

    def hidden(
        self,
        positions: np.ndarray,
        gaussians: GaussianArrays,
        world_to_camera: np.ndarray,
        K: np.ndarray,
        width: int,
        height: int,
        *,
        near: float = 0.0,
        set_back: float = 0.0,
    ) -> np.ndarray:
        """Which positions lie behind the Gaussians, seen from a camera. [N] bool

        Args:
            positions: Scene units. [N, 3]
            gaussians: Of the picture.
            world_to_camera: Rigid map, OpenCV axes. [4, 4]
            K: Intrinsics in pixels of width x height. [3, 3]
            near: Nothing nearer than this is drawn, whatever the Gaussians say. Scene units
            set_back: How much farther away the camera stands than it seems to, scene units.
        """
        self._choose(gaussians)
        cell_px = max(width / CELLS_ACROSS, 1.0)
        n_x, n_y = int(np.ceil(width / cell_px)), int(np.ceil(height / cell_px))
        _, depths, cells = _cells(self._means, world_to_camera, K, cell_px, (n_x, n_y), max(near, gaussians.near_plane))
        nearest = np.full((n_y + 2) * (n_x + 2), np.inf, np.float32)  # with a rim of empty cells
        np.minimum.at(nearest, cells, depths)
        nearest = nearest.reshape(n_y + 2, n_x + 2)
        around = np.stack([nearest[dy : dy + n_y, dx : dx + n_x] for dy in range(3) for dx in range(3)])
        is_known = np.isfinite(around)
        farthest = np.where(is_known, around, 0.0).max(axis=0)
        farthest[is_known.sum(axis=0) < MIN_KNOWN] = np.inf
        seen = np.pad(farthest, 1, constant_values=np.inf).reshape(-1)
        result = np.zeros(len(positions), bool)
        rows, mark_depths, mark_cells = _cells(positions, world_to_camera, K, cell_px, (n_x, n_y), 0.0)
        result[rows] = mark_depths - set_back > BEHIND * (seen[mark_cells] - set_back)
        return result

    def _choose(self, gaussians: GaussianArrays) -> None:
        if gaussians.key == self._key:
            return
        rows = np.flatnonzero(np.asarray(gaussians.opacities) >= OPAQUE)
        if len(rows) > MAX_LOOKED_AT:
            rows = np.random.default_rng(0).choice(rows, MAX_LOOKED_AT, replace=False)
        self._means, self._key = np.asarray(gaussians.means)[rows].astype(np.float32), gaussians.key


def _cells(
    points: np.ndarray,
    world_to_camera: np.ndarray,
    K: np.ndarray,
    cell_px: float,
    n_cells: tuple[int, int],
    near: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows of the points that lie in the picture, their depths, and their cells in a map with a rim of one cell."""
    seen = to_camera(points, world_to_camera.astype(np.float32))
    rows = np.flatnonzero(seen[:, 2] > max(near, 1e-6))
    depths = seen[rows, 2]
    x, y = (to_pixels(seen[rows], K) / cell_px).astype(np.float32).T
    is_inside = (x >= 0) & (x < n_cells[0]) & (y >= 0) & (y < n_cells[1])
    cells = (y[is_inside].astype(np.int64) + 1) * (n_cells[0] + 2) + x[is_inside].astype(np.int64) + 1
    return rows[is_inside], depths[is_inside], cells
