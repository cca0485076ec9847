"""The matrix of frames and cameras as numbers: which cells share a pixel, and which cell lies under the pointer."""

from __future__ import annotations

import warnings

import numpy as np


def pixel_cells(n_cells: int, n_pixels: int) -> np.ndarray:
    """Which cell each pixel of a side shows, where there are at least as many pixels as cells. [n_pixels] int64"""
    return np.arange(n_pixels, dtype=np.int64) * n_cells // max(n_pixels, 1)


def frames_per_column(n_frames: int, n_pixels: int) -> int:
    """Frames that share a column of pixels; 1 where there is room for all."""
    return max(1, -(-n_frames // max(n_pixels, 1)))


def worst_of(cells: np.ndarray, n: int, *, is_higher_better: bool) -> np.ndarray:
    """The worst of every n frames: what stands out must not vanish where there is no room for all of them.

    Args:
        cells: NaN where not measured. [n_frames, n_cameras]
    Returns:
        [ceil(n_frames / n), n_cameras] float32
    """
    if n == 1:
        return cells
    n_groups = -(-len(cells) // n)
    padded = np.full((n_groups * n, cells.shape[1]), np.nan, np.float32)
    padded[: len(cells)] = cells
    groups = padded.reshape(n_groups, n, cells.shape[1])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a group without any figure has none
        return np.nanmin(groups, axis=1) if is_higher_better else np.nanmax(groups, axis=1)


def cell_at(x_share: float, y_share: float, n_frames: int, n_cameras: int) -> tuple[int, int] | None:
    """Frame and camera under a place given as shares of width and height; None outside."""
    if not (0.0 <= x_share < 1.0 and 0.0 <= y_share < 1.0) or n_frames < 1 or n_cameras < 1:
        return None
    return int(x_share * n_frames), int(y_share * n_cameras)
