"""Fill a depth map where too few cameras agree, with the smoothest surface through what they agree on.

A thin plate over inverse depth (planes in space are planes in inverse depth, so flat walls continue flat), bent
freely across grey edges, with data that disagrees with its surroundings down-weighted. Source: Terzopoulos 1988.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.ndimage import zoom
from scipy.sparse.linalg import spsolve

from engine.images.image_filters import block_mean

EDGE_GREY_LEVELS = 10.0
"""Smoothness falls by e for this grey difference."""
MEMBRANE_WEIGHT = 0.1
"""A little first-difference smoothness keeps large unseen areas from extrapolating wildly."""
MIN_BEND_WEIGHT = 0.1
HALF = 2
"""The system is solved at half size: the plate is smooth, and the solve is the costly part."""


def fill_inverse_depth(
    inverse_depth: np.ndarray, weights: np.ndarray, grey: np.ndarray, *, low: float, high: float
) -> np.ndarray:
    """A complete inverse depth map that follows the data where its weight is positive.

    Args:
        inverse_depth: [H, W], ignored where weights are 0.
        weights: Trust per pixel, 0..1. [H, W]
        grey: Guide picture, 0..255. [H, W]
        low, high: The result is clipped to these.
    Returns:
        float64 [H, W]. Without any data: the middle of low and high.
    """
    height, width = inverse_depth.shape
    weight_sums = block_mean(weights, HALF).astype(np.float64) * HALF * HALF
    weighted = block_mean(weights * inverse_depth, HALF).astype(np.float64) * HALF * HALF
    if not (weight_sums > 0).any():
        return np.full((height, width), 0.5 * (low + high))
    has_data = (weight_sums > 0).ravel()
    data = np.full(has_data.size, 0.5 * (low + high))
    data[has_data] = weighted.ravel()[has_data] / weight_sums.ravel()[has_data]
    data[~has_data] = np.median(data[has_data])
    data_weights = weight_sums.ravel() + 1e-6
    smoothness = _smoothness(block_mean(grey, HALF))
    scale = max((high - low) / 100.0, 1e-12)  # residuals are judged in hundredths of the range: about one plane
    solution, trust = data, data_weights
    for _ in range(2):
        system = (smoothness + sparse.diags(trust)).tocsc()
        solution = np.asarray(spsolve(system, trust * data, permc_spec="MMD_AT_PLUS_A"))
        trust = data_weights / (1.0 + ((solution - data) / scale) ** 2)
    coarse = np.clip(solution, low, high).reshape(height // HALF, width // HALF)
    return _enlarge(coarse, height, width)


def _smoothness(grey: np.ndarray) -> sparse.csr_matrix:
    """Quadratic form of weighted second (plate) and first (membrane) differences along rows and columns."""
    height, width = grey.shape
    index = np.arange(height * width).reshape(height, width)
    form = sparse.csr_matrix((index.size, index.size))
    for grid, guide in ((index, grey), (index.T, grey.T)):
        edges = np.exp(-np.abs(np.diff(guide, axis=1)) / EDGE_GREY_LEVELS)  # [rows, columns - 1]
        bend = np.maximum(np.minimum(edges[:, 1:], edges[:, :-1]), MIN_BEND_WEIGHT)
        plate = _differences([grid[:, :-2], grid[:, 1:-1], grid[:, 2:]], (1.0, -2.0, 1.0), bend, index.size)
        membrane = _differences([grid[:, :-1], grid[:, 1:]], (1.0, -1.0), MEMBRANE_WEIGHT * edges, index.size)
        form = form + plate.T @ plate + membrane.T @ membrane
    return form


def _differences(
    columns: list[np.ndarray], factors: tuple[float, ...], weights: np.ndarray, n_unknowns: int
) -> sparse.csr_matrix:
    """One row per pixel: sum of factors x unknowns, scaled by the row's weight."""
    n_rows = columns[0].size
    rows = np.tile(np.arange(n_rows), len(columns))
    values = np.concatenate([factor * weights.ravel() for factor in factors])
    return sparse.csr_matrix((values, (rows, np.concatenate([c.ravel() for c in columns]))), shape=(n_rows, n_unknowns))


def _enlarge(coarse: np.ndarray, height: int, width: int) -> np.ndarray:
    """Bilinear, aligned to pixel areas; an odd last row or column repeats its neighbour."""
    fine: np.ndarray = np.asarray(zoom(coarse, HALF, order=1, mode="nearest", grid_mode=True))
    return np.pad(fine, ((0, height - fine.shape[0]), (0, width - fine.shape[1])), mode="edge")
