"""Resampling through a map: each new pixel is looked up in the old picture, or is the mean of places all over it.

One pass undistorts and shrinks. The map is given on a coarse lattice, because a full one would be larger than the
pictures that are kept of a camera. Where a picture keeps its scale, its values are interpolated by cubics (Catmull and
Rom 1974), which blur less than straight lines do; where it shrinks, means of straight lines are as sharp.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from engine.kernels.fast_math import ALL, fast_math

N_STEPS = 256
"""Parts of a pixel to which a place is rounded for the weights of the cubics: an error below half a grey level."""
_SHARES = np.arange(N_STEPS + 1) / N_STEPS
WEIGHTS = np.stack(
    [
        ((-0.5 * _SHARES + 1.0) * _SHARES - 0.5) * _SHARES,
        (1.5 * _SHARES - 2.5) * _SHARES**2 + 1.0,
        ((-1.5 * _SHARES + 2.0) * _SHARES + 0.5) * _SHARES,
        (0.5 * _SHARES - 0.5) * _SHARES**2,
    ],
    axis=1,
).astype(np.float32)
"""Of the four values around a place that lies a share of a pixel behind the second one. [N_STEPS + 1, 4]"""


def remap(
    image: np.ndarray,
    lattice: np.ndarray,
    step_px: int,
    size: tuple[int, int],
    n_sub: int,
    is_valid: np.ndarray,
) -> np.ndarray:
    """Picture whose pixels come from places of another.

    Args:
        image: [H, W, 3] uint8
        lattice: Where the corners of squares of the new picture lie in the old one, x and y with pixel centres at
            +0.5: entry [i, j] belongs to the place (j * step_px, i * step_px). float32 [rows, columns, 2]
        step_px: Side of those squares, pixels of the new picture.
        size: New width and height.
        n_sub: Places taken along each side of a new pixel: 1 / scale, rounded up, so that none is left out.
        is_valid: Pixels of the new picture that are wanted; the others become black. [new H, new W] bool
    Returns:
        [new H, new W, 3] uint8. Places outside of the old picture have the colour of its border.
    """
    width, height = size
    out = np.zeros((height, width, 3), np.uint8)
    image, line = np.ascontiguousarray(image), np.empty((2, lattice.shape[1]), np.float32)
    if n_sub == 1:
        _interpolate(image, lattice, step_px, is_valid, WEIGHTS, line, out)
    else:
        _average(image, lattice, step_px, n_sub, is_valid, line, np.empty((width, 3), np.float32), out)
    return out


@njit(nogil=True, error_model="numpy")
def _lattice_line(lattice, v, line):
    """Writes the lattice at v of its rows, less half a pixel: places between middles of pixels. line: [2, columns]"""
    row = min(int(v), lattice.shape[0] - 2)
    down = np.float32(v - row)
    for k in range(2):
        for column in range(lattice.shape[1]):
            above, below = lattice[row, column, k], lattice[row + 1, column, k]
            line[k, column] = above + down * (below - above) - np.float32(0.5)


@njit(nogil=True, error_model="numpy", inline="always")
def _at(line, k, u, last):
    """The line at u of its columns, kept within 0 .. last."""
    column = int(u)
    left = line[k, column]
    place = left + (u - np.float32(column)) * (line[k, column + 1] - left)
    return min(max(place, np.float32(0.0)), last)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=fast_math(*ALL))
def _interpolate(image, lattice, step_px, is_valid, weights, line, out):
    height, width = image.shape[0], image.shape[1]
    values, stride = image.reshape(-1), 3 * width
    last_x, last_y = np.float32(width - 1), np.float32(height - 1)
    inverse_step, half, n_steps = np.float32(1.0 / step_px), np.float32(0.5), np.float32(weights.shape[0] - 1)
    for i in range(out.shape[0]):
        _lattice_line(lattice, (i + 0.5) / step_px, line)
        for j in range(out.shape[1]):
            if not is_valid[i, j]:
                continue
            u = (np.float32(j) + half) * inverse_step
            x, y = _at(line, 0, u, last_x), _at(line, 1, u, last_y)
            x0, y0 = int(x), int(y)
            across, down = int((x - np.float32(x0)) * n_steps + half), int((y - np.float32(y0)) * n_steps + half)
            red = green = blue = half
            if 1 <= x0 < width - 2 and 1 <= y0 < height - 2:
                w0, w1, w2, w3 = weights[across, 0], weights[across, 1], weights[across, 2], weights[across, 3]
                first = (y0 - 1) * stride + 3 * (x0 - 1)
                for a in range(4):
                    weight, p = weights[down, a], first + a * stride
                    red += weight * (w0 * values[p] + w1 * values[p + 3] + w2 * values[p + 6] + w3 * values[p + 9])
                    green += weight * (
                        w0 * values[p + 1] + w1 * values[p + 4] + w2 * values[p + 7] + w3 * values[p + 10]
                    )
                    blue += weight * (
                        w0 * values[p + 2] + w1 * values[p + 5] + w2 * values[p + 8] + w3 * values[p + 11]
                    )
            else:
                for a in range(4):
                    row = min(max(y0 - 1 + a, 0), height - 1)
                    for k in range(4):
                        column = min(max(x0 - 1 + k, 0), width - 1)
                        weight = weights[down, a] * weights[across, k]
                        red += weight * np.float32(image[row, column, 0])
                        green += weight * np.float32(image[row, column, 1])
                        blue += weight * np.float32(image[row, column, 2])
            out[i, j, 0] = np.uint8(min(max(red, np.float32(0.0)), np.float32(255.0)))
            out[i, j, 1] = np.uint8(min(max(green, np.float32(0.0)), np.float32(255.0)))
            out[i, j, 2] = np.uint8(min(max(blue, np.float32(0.0)), np.float32(255.0)))


@njit(cache=True, nogil=True, error_model="numpy", fastmath=fast_math(*ALL))
def _average(image, lattice, step_px, n_sub, is_valid, line, sums, out):
    height, width = image.shape[0], image.shape[1]
    last_x, last_y = np.float32(width - 1), np.float32(height - 1)
    half, one = np.float32(0.5), np.float32(1.0)
    share, pace = np.float32(1.0 / (n_sub * n_sub)), 1.0 / n_sub
    for i in range(out.shape[0]):
        sums[:] = 0.0
        for a in range(n_sub):
            _lattice_line(lattice, (i + (a + 0.5) * pace) / step_px, line)
            for j in range(out.shape[1]):
                if not is_valid[i, j]:
                    continue
                red = green = blue = np.float32(0.0)
                for b in range(n_sub):
                    u = np.float32((j + (b + 0.5) * pace) / step_px)
                    x, y = _at(line, 0, u, last_x), _at(line, 1, u, last_y)
                    x0, y0 = int(x), int(y)
                    x1, y1 = min(x0 + 1, width - 1), min(y0 + 1, height - 1)
                    right, down = x - np.float32(x0), y - np.float32(y0)
                    w11 = down * right
                    w10, w01 = down - w11, right - w11
                    w00 = one - right - w10
                    red += w00 * np.float32(image[y0, x0, 0]) + w01 * np.float32(image[y0, x1, 0])
                    red += w10 * np.float32(image[y1, x0, 0]) + w11 * np.float32(image[y1, x1, 0])
                    green += w00 * np.float32(image[y0, x0, 1]) + w01 * np.float32(image[y0, x1, 1])
                    green += w10 * np.float32(image[y1, x0, 1]) + w11 * np.float32(image[y1, x1, 1])
                    blue += w00 * np.float32(image[y0, x0, 2]) + w01 * np.float32(image[y0, x1, 2])
                    blue += w10 * np.float32(image[y1, x0, 2]) + w11 * np.float32(image[y1, x1, 2])
                sums[j, 0] += red
                sums[j, 1] += green
                sums[j, 2] += blue
        for j in range(out.shape[1]):
            if is_valid[i, j]:
                for k in range(3):
                    out[i, j, k] = np.uint8(sums[j, k] * share + half)
