"""Resampling through a map: each new pixel is the mean of places all over it, looked up in the old picture.

One pass undistorts and shrinks. The map is given on a coarse lattice, because a full one would be larger than the
pictures that are kept of a camera.
"""

from __future__ import annotations

import numpy as np
from numba import njit


def remap(image: np.ndarray, lattice: np.ndarray, step_px: int, size: tuple[int, int], n_sub: int) -> np.ndarray:
    """Picture whose pixels come from places of another.

    Args:
        image: [H, W, 3] uint8
        lattice: Where the corners of squares of the new picture lie in the old one, x and y with pixel centres at
            +0.5: entry [i, j] belongs to the place (j * step_px, i * step_px). float32 [rows, columns, 2]
        step_px: Side of those squares, pixels of the new picture.
        size: New width and height.
        n_sub: Places taken along each side of a new pixel: 1 / scale, rounded up, so that none is left out.
    Returns:
        [new H, new W, 3] uint8. Places outside of the old picture have the colour of its border.
    """
    width, height = size
    out = np.empty((height, width, 3), np.uint8)
    _remap(np.ascontiguousarray(image), lattice, step_px, n_sub, out)
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _remap(image, lattice, step_px, n_sub, out):
    height, width = image.shape[0], image.shape[1]
    share = np.float32(1.0 / (n_sub * n_sub))
    pace = np.float32(1.0 / n_sub)
    last_x, last_y = np.float32(width - 1), np.float32(height - 1)
    inverse_step = np.float32(1.0 / step_px)
    half = np.float32(0.5)
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            red = green = blue = np.float32(0.0)
            for a in range(n_sub):
                v = (np.float32(i) + (np.float32(a) + half) * pace) * inverse_step
                row = min(int(v), lattice.shape[0] - 2)
                down = v - np.float32(row)
                for b in range(n_sub):
                    u = (np.float32(j) + (np.float32(b) + half) * pace) * inverse_step
                    column = min(int(u), lattice.shape[1] - 2)
                    right = u - np.float32(column)
                    w00 = (np.float32(1.0) - down) * (np.float32(1.0) - right)
                    w01 = (np.float32(1.0) - down) * right
                    w10 = down * (np.float32(1.0) - right)
                    w11 = down * right
                    x = (
                        w00 * lattice[row, column, 0]
                        + w01 * lattice[row, column + 1, 0]
                        + w10 * lattice[row + 1, column, 0]
                        + w11 * lattice[row + 1, column + 1, 0]
                    ) - half
                    y = (
                        w00 * lattice[row, column, 1]
                        + w01 * lattice[row, column + 1, 1]
                        + w10 * lattice[row + 1, column, 1]
                        + w11 * lattice[row + 1, column + 1, 1]
                    ) - half
                    x = min(max(x, np.float32(0.0)), last_x)
                    y = min(max(y, np.float32(0.0)), last_y)
                    x0, y0 = int(x), int(y)
                    x1, y1 = min(x0 + 1, width - 1), min(y0 + 1, height - 1)
                    fx, fy = x - np.float32(x0), y - np.float32(y0)
                    f00 = (np.float32(1.0) - fy) * (np.float32(1.0) - fx)
                    f01 = (np.float32(1.0) - fy) * fx
                    f10 = fy * (np.float32(1.0) - fx)
                    f11 = fy * fx
                    red += (
                        f00 * image[y0, x0, 0]
                        + f01 * image[y0, x1, 0]
                        + f10 * image[y1, x0, 0]
                        + f11 * image[y1, x1, 0]
                    )
                    green += (
                        f00 * image[y0, x0, 1]
                        + f01 * image[y0, x1, 1]
                        + f10 * image[y1, x0, 1]
                        + f11 * image[y1, x1, 1]
                    )
                    blue += (
                        f00 * image[y0, x0, 2]
                        + f01 * image[y0, x1, 2]
                        + f10 * image[y1, x0, 2]
                        + f11 * image[y1, x1, 2]
                    )
            out[i, j, 0] = np.uint8(red * share + half)
            out[i, j, 1] = np.uint8(green * share + half)
            out[i, j, 2] = np.uint8(blue * share + half)
