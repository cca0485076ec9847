"""Optical flow between two grey pictures by Farneback's method, as OpenCV computes it with its usual parameters.

Around every pixel a picture is a quadratic polynomial; how the polynomials of two pictures differ says how far what is
there has moved, averaged over a window, on a pyramid from coarse to fine. Borders, window and pyramid are those of
cv2.calcOpticalFlowFarneback(before, after, None, 0.5, 3, 15, 3, 5, 1.2, 0), of which published tOF figures are made.
Source: Farneback 2003, "Two-frame motion estimation based on polynomial expansion". Kernels release the GIL and use
one thread.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy import ndimage

PYRAMID_SCALE = 0.5
N_LEVELS = 3
"""Coarser levels at most, beside the picture itself."""
MIN_SIDE_PX = 32
"""No level has a shorter side, but for the picture itself."""
WINDOW_PX = 15
N_ITERATIONS = 3
RADIUS, SIGMA_PX = 5, 1.2
"""Of the neighbourhood that a polynomial is fitted to."""
_BORDER = np.array([0.14, 0.14, 0.4472, 0.4472, 0.4472], np.float32)
"""What the outermost pixels weigh."""
_REGULARISER = 1e-3
"""Keeps the flow of what has no texture finite, and near zero."""


class _Weights(NamedTuple):
    """Of the fit of a polynomial: Gaussian, times offset, times its square [RADIUS + 1], and of the inverse matrix."""

    g: np.ndarray
    xg: np.ndarray
    xxg: np.ndarray
    linear: np.float32
    constant: np.float32
    square: np.float32
    mixed: np.float32


Expansion = list[np.ndarray]
"""Of one picture, finest level first: the coefficients of y, x, y^2, x^2 and x y of every pixel. [5, h, w] float32"""


def expansion_of(grey: np.ndarray) -> Expansion:
    """The polynomials of a picture on all levels, for `flow_between`.

    Args:
        grey: Brightness 0 to 255. [H, W]
    Raises:
        ValueError: The picture has no pixels.
    """
    height, width = grey.shape
    if not grey.size:
        raise ValueError("there is no optical flow of pictures without pixels")
    picture = np.ascontiguousarray(grey, np.float32)
    found = []
    for level in range(_n_levels(height, width) + 1):
        scale = PYRAMID_SCALE**level
        blurred = _blurred(picture, 0.5 * (1.0 / scale - 1.0))
        small = resized(blurred, round(height * scale), round(width * scale))
        planes = np.empty((5, *small.shape), np.float32)
        _expand(small, *_WEIGHTS, planes)
        found.append(planes)
    return found


def flow_between(before: Expansion, after: Expansion) -> np.ndarray:
    """How far what a pixel shows moves to the right and down until the later picture, px. [H, W, 2] float32

    Raises:
        ValueError: The pictures differ in size.
    """
    if before[0].shape != after[0].shape:
        raise ValueError(f"pictures of {before[0].shape[1:]} and {after[0].shape[1:]} pixels have no flow between them")
    flow = np.zeros((2, *before[-1].shape[1:]), np.float32)
    for first, second in zip(reversed(before), reversed(after), strict=True):
        _, height, width = first.shape
        if flow.shape[1:] != (height, width):
            parts = (resized(flow[axis], height, width) for axis in (0, 1))
            flow = np.stack([part / np.float32(PYRAMID_SCALE) for part in parts])
        sums = np.empty_like(first)
        for _ in range(N_ITERATIONS):
            _compare(first, second, flow, _BORDER, sums)
            _solve(sums, WINDOW_PX // 2, np.float32(_REGULARISER), flow)
    return np.ascontiguousarray(flow.transpose(1, 2, 0))


def optical_flow(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """`flow_between` of two grey pictures. [H, W, 2] float32"""
    return flow_between(expansion_of(before), expansion_of(after))


def warm_up() -> None:
    """Compile the kernels, or load them from the cache, by comparing pictures of one pixel."""
    optical_flow(np.zeros((1, 1), np.float32), np.zeros((1, 1), np.float32))


def resized(values: np.ndarray, height: int, width: int) -> np.ndarray:
    """Values at the pixels of another size, linear between the four nearest, the border's beyond. [height, width]"""
    for axis, length in enumerate((height, width)):
        n = values.shape[axis]
        place = np.clip((np.arange(length) + 0.5) * (n / length) - 0.5, 0.0, n - 1.0)
        low = np.minimum(place.astype(np.int64), max(n - 2, 0))
        share = (place - low).astype(np.float32)
        share = share[:, None] if axis == 0 else share
        near, far = values.take(low, axis), values.take(np.minimum(low + 1, n - 1), axis)
        values = near + share * (far - near)
    return values


def _n_levels(height: int, width: int) -> int:
    n = 0
    while n < N_LEVELS and min(height, width) * PYRAMID_SCALE ** (n + 1) >= MIN_SIDE_PX:
        n += 1
    return n


def _blurred(picture: np.ndarray, sigma_px: float) -> np.ndarray:
    """Against what a coarser level cannot show; the picture itself is blurred a little too."""
    radius = max(round(5 * sigma_px) | 1, 3) // 2
    offsets = np.arange(-radius, radius + 1)
    taps = np.exp(-0.5 * (offsets / sigma_px) ** 2) if sigma_px else np.array([1.0, 2.0, 1.0])
    taps = taps / taps.sum()
    for axis in (0, 1):
        picture = ndimage.correlate1d(picture, taps, axis, mode="mirror" if picture.shape[axis] > 1 else "nearest")
    return picture


def _fit_weights() -> _Weights:
    x = np.arange(-RADIUS, RADIUS + 1, dtype=np.float64)
    g = np.exp(-(x**2) / (2 * SIGMA_PX**2))
    g /= g.sum()
    basis = [np.ones((len(x), len(x))), *np.meshgrid(x, x), *(part**2 for part in np.meshgrid(x, x)), np.outer(x, x)]
    products = np.array([[np.einsum("yx,yx,y,x", a, b, g, g) for a in basis] for b in basis])
    inverse = np.linalg.inv(products)
    g_half, xg, xxg = (part[RADIUS:].astype(np.float32) for part in (g, x * g, x**2 * g))
    linear, constant, square, mixed = (np.float32(inverse[at]) for at in ((1, 1), (0, 3), (3, 3), (5, 5)))
    return _Weights(g_half, xg, xxg, linear, constant, square, mixed)


_WEIGHTS = _fit_weights()


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _expand(picture, g, xg, xxg, linear, constant, square, mixed, planes):
    """Writes planes [5, H, W]: coefficients of y, x, y^2, x^2, x y."""
    height, width = picture.shape
    radius = len(g) - 1
    rows = np.empty((3, width + 2 * radius), np.float32)
    for y in range(height):
        for x in range(width):
            rows[0, x + radius] = picture[y, x] * g[0]
            rows[1, x + radius] = np.float32(0)
            rows[2, x + radius] = np.float32(0)
        for k in range(1, radius + 1):
            above, below = max(y - k, 0), min(y + k, height - 1)
            for x in range(width):
                both = picture[above, x] + picture[below, x]
                rows[0, x + radius] += g[k] * both
                rows[1, x + radius] += xg[k] * (picture[below, x] - picture[above, x])
                rows[2, x + radius] += xxg[k] * both
        for part in range(3):
            for i in range(radius):
                rows[part, i] = rows[part, radius]
                rows[part, width + radius + i] = rows[part, width + radius - 1]
        for x in range(width):
            at = x + radius
            b1, b2, b3 = rows[0, at] * g[0], np.float32(0), rows[1, at] * g[0]
            b4, b5, b6 = np.float32(0), rows[2, at] * g[0], np.float32(0)
            for k in range(1, radius + 1):
                both = rows[0, at + k] + rows[0, at - k]
                b1 += both * g[k]
                b4 += both * xxg[k]
                b2 += (rows[0, at + k] - rows[0, at - k]) * xg[k]
                b3 += (rows[1, at + k] + rows[1, at - k]) * g[k]
                b6 += (rows[1, at + k] - rows[1, at - k]) * xg[k]
                b5 += (rows[2, at + k] + rows[2, at - k]) * g[k]
            planes[0, y, x] = b3 * linear
            planes[1, y, x] = b2 * linear
            planes[2, y, x] = b1 * constant + b5 * square
            planes[3, y, x] = b1 * constant + b4 * square
            planes[4, y, x] = b6 * mixed


@njit(cache=True, nogil=True, error_model="numpy")
def _compare(first, second, flow, border, sums):
    """Writes sums [5, H, W]: the matrix and the right-hand side of every pixel, for where the flow leads now."""
    _, height, width = first.shape
    n = len(border)
    half, quarter = np.float32(0.5), np.float32(0.25)
    for y in range(height):
        weight_y = border[y] if y < n else np.float32(1)
        if y >= height - n:
            weight_y *= border[height - 1 - y]
        for x in range(width):
            dx, dy = flow[0, y, x], flow[1, y, x]
            to_x, to_y = np.float32(x) + dx, np.float32(y) + dy
            floor_x, floor_y = np.floor(to_x), np.floor(to_y)
            if floor_x >= 0 and floor_x < width - 1 and floor_y >= 0 and floor_y < height - 1:
                x1, y1 = int(floor_x), int(floor_y)
                share_x, share_y = to_x - floor_x, to_y - floor_y
                a, b = (1 - share_x) * (1 - share_y), share_x * (1 - share_y)
                c, d = (1 - share_x) * share_y, share_x * share_y
                r2 = a * second[0, y1, x1] + b * second[0, y1, x1 + 1]
                r2 += c * second[0, y1 + 1, x1] + d * second[0, y1 + 1, x1 + 1]
                r3 = a * second[1, y1, x1] + b * second[1, y1, x1 + 1]
                r3 += c * second[1, y1 + 1, x1] + d * second[1, y1 + 1, x1 + 1]
                r4 = a * second[2, y1, x1] + b * second[2, y1, x1 + 1]
                r4 += c * second[2, y1 + 1, x1] + d * second[2, y1 + 1, x1 + 1]
                r5 = a * second[3, y1, x1] + b * second[3, y1, x1 + 1]
                r5 += c * second[3, y1 + 1, x1] + d * second[3, y1 + 1, x1 + 1]
                r6 = a * second[4, y1, x1] + b * second[4, y1, x1 + 1]
                r6 += c * second[4, y1 + 1, x1] + d * second[4, y1 + 1, x1 + 1]
                r4 = (first[2, y, x] + r4) * half
                r5 = (first[3, y, x] + r5) * half
                r6 = (first[4, y, x] + r6) * quarter
            else:
                r2, r3 = np.float32(0), np.float32(0)
                r4, r5, r6 = first[2, y, x], first[3, y, x], first[4, y, x] * half
            r2 = (first[0, y, x] - r2) * half + r4 * dy + r6 * dx
            r3 = (first[1, y, x] - r3) * half + r6 * dy + r5 * dx
            weight = weight_y
            if x < n:
                weight *= border[x]
            if x >= width - n:
                weight *= border[width - 1 - x]
            weight *= weight
            sums[0, y, x] = (r4 * r4 + r6 * r6) * weight
            sums[1, y, x] = (r4 + r5) * r6 * weight
            sums[2, y, x] = (r5 * r5 + r6 * r6) * weight
            sums[3, y, x] = (r4 * r2 + r6 * r3) * weight
            sums[4, y, x] = (r6 * r2 + r5 * r3) * weight


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _solve(sums, radius, regulariser, flow):
    """Writes flow [2, H, W] from means of the sums over the window; the border's values stand beyond it."""
    _, height, width = sums.shape
    columns = np.empty((5, width + 2 * radius + 1), np.float64)
    window = np.empty((5, width), np.float32)
    scale = 1.0 / ((2 * radius + 1) * (2 * radius + 1))
    for part in range(5):
        for x in range(width):
            total = 0.0
            for k in range(-radius, radius + 1):
                total += sums[part, min(max(k, 0), height - 1), x]
            columns[part, x + radius] = total
    for y in range(height):
        if y > 0:
            leaving, coming = max(y - radius - 1, 0), min(y + radius, height - 1)
            for part in range(5):
                for x in range(width):
                    columns[part, x + radius] += np.float64(sums[part, coming, x]) - np.float64(sums[part, leaving, x])
        for part in range(5):
            for i in range(radius):
                columns[part, i] = columns[part, radius]
                columns[part, width + radius + i] = columns[part, width + radius - 1]
            total = 0.0
            for i in range(2 * radius):
                total += columns[part, i]
            for x in range(width):
                total += columns[part, x + 2 * radius]
                window[part, x] = np.float32(total * scale)
                total -= columns[part, x]
        for x in range(width):
            g11, g12, g22 = window[0, x], window[1, x], window[2, x]
            h1, h2 = window[3, x], window[4, x]
            determinant = g11 * g22 - g12 * g12 + regulariser
            flow[0, y, x] = (g11 * h2 - g12 * h1) / determinant
            flow[1, y, x] = (g22 * h1 - g12 * h2) / determinant
