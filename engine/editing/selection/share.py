"""How much of each pixel selected Gaussians make up, to show them where they are seen. One compiled kernel."""

from __future__ import annotations

import numpy as np
from numba import njit

from engine.conventions import ALPHA_MAX, ALPHA_MIN
from engine.editing.selection.projected import ProjectedGaussians
from engine.editing.selection.visibility import footprint, small_picture

ENOUGH = 0.1
"""Where less light than this is left, the Gaussians behind are not looked at."""


def selected_share(projected: ProjectedGaussians, opacities: np.ndarray, selected: np.ndarray) -> np.ndarray:
    """Share of the selected ones in the picture, blended as the rasterizer does, in a small picture of the view.

    Args:
        opacities: In 0..1. [N]
        selected: [N] bool
    Returns:
        In 0..1. [h, w] float32
    """
    scale, width, height = small_picture(projected.view)
    opacities = np.ascontiguousarray(opacities, np.float64)
    share, left = np.zeros((height, width), np.float32), np.ones((height, width), np.float32)
    rows = np.flatnonzero(projected.is_before & (opacities >= ALPHA_MIN))
    if np.any(selected):
        order = rows[np.argsort(projected.depths[rows])]
        selected = np.ascontiguousarray(selected, np.bool_)
        _share(projected.centers, projected.spreads, opacities, selected, order, scale, left, share)
    return share


@njit(cache=True, nogil=True, error_model="numpy")
def _share(centers, spreads, opacities, selected, order, scale, left, share):
    height, width = share.shape
    for k in range(len(order)):
        i = order[k]
        limit = np.log(opacities[i] / ALPHA_MIN)
        u, v, ixx, ixy, iyy, _, _, _, first_x, last_x, first_y, last_y = footprint(
            centers, spreads, np.sqrt(2.0 * limit), i, scale, height, width
        )
        is_selected = selected[i]
        for row in range(first_y, last_y + 1):
            dy = row + 0.5 - v
            for column in range(first_x, last_x + 1):
                if left[row, column] <= ENOUGH:
                    continue
                dx = column + 0.5 - u
                power = 0.5 * (ixx * dx * dx + iyy * dy * dy) + ixy * dx * dy
                if power > limit:
                    continue
                alpha = np.float32(min(opacities[i] * np.exp(-power), ALPHA_MAX))
                if is_selected:
                    share[row, column] += alpha * left[row, column]
                left[row, column] *= np.float32(1.0) - alpha
