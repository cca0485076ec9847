"""A picture in the truth's smooth local brightness: what is left is an error of shape and texture.

Daylight that moves, or a shadow of somebody out of sight, changes the brightness of whole parts of a picture. One
factor per block of a coarse grid follows that, between the blocks it is interpolated. Blocks in which nothing stands
still take over the factor of their neighbours. Pictures are [H, W, 3] in 0..1, masks [H, W] bool.
"""

from __future__ import annotations

import numpy as np

N_BLOCKS = 16
"""Blocks across the picture; as many down as make them square."""
FURTHEST = 2.0
"""No factor is larger than this, or smaller than one over this."""
_MIN_SHARE = 0.05
"""A block with fewer pixels that stand still says nothing."""
_DARK = 0.01
"""Mean brightness that is added to both pictures, so that black does not decide."""


def fit_light(image: np.ndarray, truth: np.ndarray, is_still: np.ndarray) -> np.ndarray | None:
    """The image times the smooth factor that fits the brightness of the truth where nothing moves.

    Returns:
        Neither rounded nor clamped [H, W, 3] float32; None where no block has enough pixels that stand still.
    """
    height, width = is_still.shape
    n_down = max(1, round(N_BLOCKS * height / width))
    edges_y, edges_x = (_edges(height, n_down), _edges(width, N_BLOCKS))
    weight = is_still.astype(np.float32)
    n_still = _block_sums(weight, edges_y, edges_x)
    n_pixels = np.outer(np.diff(edges_y), np.diff(edges_x))
    is_known = n_still >= np.maximum(_MIN_SHARE * n_pixels, 1.0)
    if not is_known.any():
        return None
    ours, theirs = (_block_sums(np.einsum("hwc->hw", picture) * weight, edges_y, edges_x) for picture in (image, truth))
    added = 3.0 * _DARK * n_still
    with np.errstate(divide="ignore", invalid="ignore"):
        factors = np.clip((theirs + added) / (ours + added), 1.0 / FURTHEST, FURTHEST)
    smooth = _interpolated(_filled(factors, is_known), edges_y, edges_x)
    return (image * smooth[:, :, None]).astype(np.float32, copy=False)


def _edges(length: int, n_blocks: int) -> np.ndarray:
    """First pixels of the blocks, and the end; at least a pixel each. [n + 1]"""
    return np.unique(np.round(np.linspace(0, length, min(n_blocks, length) + 1)).astype(np.int64))


def _block_sums(values: np.ndarray, edges_y: np.ndarray, edges_x: np.ndarray) -> np.ndarray:
    """[H, W] to [n_down, n_across] float64"""
    rows = np.add.reduceat(values, edges_x[:-1], axis=1)
    return np.add.reduceat(rows.astype(np.float64), edges_y[:-1], axis=0)


def _filled(factors: np.ndarray, is_known: np.ndarray) -> np.ndarray:
    """Unknown blocks get the mean of known neighbours, from the edge of what is known outwards."""
    values, known = np.where(is_known, factors, 0.0), is_known.astype(np.float64)
    while not known.all():
        around, count = _sum_around(values), _sum_around(known)
        is_new = (known == 0) & (count > 0)
        values[is_new] = around[is_new] / count[is_new]
        known[is_new] = 1.0
    return values


def _sum_around(values: np.ndarray) -> np.ndarray:
    """Sum over a block and its eight neighbours."""
    padded = np.pad(values, 1)
    rows = padded[:-2] + padded[1:-1] + padded[2:]
    return rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:]


def _interpolated(factors: np.ndarray, edges_y: np.ndarray, edges_x: np.ndarray) -> np.ndarray:
    """A factor per pixel, bilinear between the middles of blocks, constant beyond the outermost. [H, W] float32"""
    return (_weights(edges_y) @ factors.astype(np.float32)) @ _weights(edges_x).T


def _weights(edges: np.ndarray) -> np.ndarray:
    """Of each block at each pixel. [length, n] float32"""
    middles = (edges[:-1] + edges[1:]) / 2
    pixels = np.arange(edges[-1]) + 0.5
    return np.stack([np.interp(pixels, middles, row) for row in np.eye(len(middles))], axis=1).astype(np.float32)
