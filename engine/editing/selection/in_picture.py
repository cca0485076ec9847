"""Which Gaussians lie under a mask of pixels: by their centres, or as far as they are seen."""

from __future__ import annotations

import numpy as np
from numba import njit

from engine.conventions import EPS2D_PX2
from engine.editing.selection.projected import ProjectedGaussians

EXTENT_SIGMAS = 2.0
"""By extent, a Gaussian reaches as far as this, standard deviations."""


def under_mask(projected: ProjectedGaussians, mask: np.ndarray, *, is_by_extent: bool = False) -> np.ndarray:
    """Gaussians before the camera whose centre lies in a pixel of the mask.

    Args:
        mask: [H, W] bool, of the size of the view.
        is_by_extent: It is enough that one pixel of the mask lies within EXTENT_SIGMAS of a Gaussian.
    Returns:
        [N] bool
    Raises:
        ValueError: The mask is of another size.
    """
    view = projected.view
    if mask.shape != (view.height, view.width):
        raise ValueError(f"a mask of {mask.shape[::-1]} does not belong to a picture of {view.size}")
    found = np.zeros(len(projected), np.bool_)
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if len(rows) == 0:
        return found
    reach = EXTENT_SIGMAS if is_by_extent else 0.0
    box = np.array([columns[0], rows[0], columns[-1], rows[-1]], np.int64)
    _under(projected.centers, projected.spreads, projected.is_before, np.ascontiguousarray(mask), box, reach, found)
    return found


@njit(cache=True, nogil=True, error_model="numpy")
def _under(centers, spreads, is_before, mask, box, reach, found):
    for i in range(len(centers)):
        if not is_before[i]:
            continue
        u, v = centers[i, 0], centers[i, 1]
        if box[0] <= u < box[2] + 1 and box[1] <= v < box[3] + 1 and mask[int(v), int(u)]:
            found[i] = True
            continue
        if reach == 0.0:
            continue
        xx, xy, yy = spreads[i, 0] + EPS2D_PX2, spreads[i, 1], spreads[i, 2] + EPS2D_PX2
        half_x, half_y = reach * np.sqrt(xx), reach * np.sqrt(yy)
        if u + half_x < box[0] or u - half_x > box[2] + 1 or v + half_y < box[1] or v - half_y > box[3] + 1:
            continue
        area = xx * yy - xy * xy
        if not 0.0 < area < np.inf:
            continue
        scale = 1.0 / area
        first_x, last_x = int(max(np.ceil(u - half_x - 0.5), box[0])), int(min(np.floor(u + half_x - 0.5), box[2]))
        first_y, last_y = int(max(np.ceil(v - half_y - 0.5), box[1])), int(min(np.floor(v + half_y - 0.5), box[3]))
        for row in range(first_y, last_y + 1):
            dy = row + 0.5 - v
            for column in range(first_x, last_x + 1):
                if not mask[row, column]:
                    continue
                dx = column + 0.5 - u
                if scale * (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) <= reach * reach:
                    found[i] = True
                    break
            if found[i]:
                break
