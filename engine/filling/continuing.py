"""Continuing pictures into holes: inverse depth as a soap film over the hole, colours by inpainting.

Inverse depth is linear in the picture on every plane, and a soap film between linear borders is linear: a wall or a
floor goes on as a plane, exactly. Across a corner it goes smoothly from one plane to the other.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from engine.filling.masks import labelled
from engine.images.image_filters import dilate

INPAINT_PX = 4.0
"""Colours come from this far away."""
_NEIGHBOURS = ((0, 1), (0, -1), (1, 0), (-1, 0))


def continued_depth(depth: np.ndarray, is_hole: np.ndarray) -> np.ndarray:
    """Depth in a hole, from the depth around it.

    Args:
        depth: Of surfaces; not positive where unknown. [H, W]
        is_hole: Pixels to fill. [H, W] bool
    Returns:
        Depth in the hole; NaN elsewhere, and in parts of a hole with nothing known around them. [H, W] float64
    """
    height, width = depth.shape
    is_known = (depth > 0) & np.isfinite(depth) & ~is_hole
    inverse = np.where(is_known, 1.0 / np.where(is_known, depth, 1.0), 0.0)
    number = np.full(depth.shape, -1, np.int64)
    parts, n_parts = labelled(is_hole)
    has_border = np.zeros(n_parts + 1, bool)
    has_border[np.unique(parts[dilate(is_known, 1) & is_hole])] = True
    is_solved = is_hole & has_border[parts]
    n = int(is_solved.sum())
    out = np.full(depth.shape, np.nan)
    if not n:
        return out
    number[is_solved] = np.arange(n)
    ys, xs = is_solved.nonzero()
    diagonal, right, rows, columns = np.zeros(n), np.zeros(n), [], []
    for dy, dx in _NEIGHBOURS:
        y, x = ys + dy, xs + dx
        is_inside = (y >= 0) & (y < height) & (x >= 0) & (x < width)
        y, x = np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)
        is_next, is_border = is_inside & (number[y, x] >= 0), is_inside & is_known[y, x]
        diagonal += is_next.astype(float) + is_border
        right += np.where(is_border, inverse[y, x], 0.0)
        rows.append(np.flatnonzero(is_next))
        columns.append(number[y, x][is_next])
    rows, columns = np.concatenate(rows), np.concatenate(columns)
    matrix = sparse.coo_matrix((-np.ones(len(rows)), (rows, columns)), (n, n)) + sparse.diags(diagonal)
    solved: Any = spsolve(matrix.tocsc(), right)
    found = np.atleast_1d(solved)
    out[ys, xs] = np.where(found > 0, 1.0 / np.where(found > 0, found, 1.0), np.nan)
    return out


def continued_colors(image: np.ndarray, is_hole: np.ndarray) -> np.ndarray:
    """A picture with its holes filled from around them.

    Args:
        image: In 0..1. [H, W, 3]
        is_hole: [H, W] bool
    Returns:
        [H, W, 3] float32
    """
    eight_bit = np.rint(np.clip(image, 0.0, 1.0) * 255.0).astype(np.uint8)
    filled = cv2.inpaint(eight_bit, is_hole.astype(np.uint8), INPAINT_PX, cv2.INPAINT_TELEA)
    return filled.astype(np.float32) / 255.0
