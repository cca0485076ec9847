"""Slanted patches: every pixel looks for the plane through its surface that the other cameras confirm best.

A sweep over planes parallel to the picture fails where neighbours see a surface from elsewhere: a floor seen from 30
degrees aside shears by more than a patch can bear. Here each pixel has a plane of its own, which it gets from its
neighbours, from chance and from the map to begin with, and keeps as long as no other one matches better.
Source: Bleyer, Rhemann, Rother 2011, "PatchMatch Stereo". A plane in space is affine in inverse depth over the pixels.
Letters: H W working picture size, S sources of one camera.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from engine.camera.projection import relative_homography
from engine.camera.rig import CameraRig
from engine.cloud.stereo.depth.sweep import GREY_TRUNCATION, GREY_WEIGHT, STD_FLOOR, UNKNOWN_COST
from engine.kernels.fast_math import ALL, fast_math

RADIUS_PX = 4
STRIDE_PX = 2
"""A patch is 9 x 9 pixels, of which every other one in each direction is compared."""
EDGE_GREY_LEVELS = 20.0
"""A pixel of the patch counts less by e for this grey difference to its middle: it may lie on another surface."""
N_SCANS = 4
"""Passes over the picture, alternating in direction."""
N_NEIGHBORS = 6
FAR_PX = 5
"""Planes are taken from six pixels: three next to this one, and three this far away."""
N_CHANCES = 2
"""Planes by chance that each pixel begins with, besides those of the map."""
MAX_SLOPE = 0.1
"""Slope of planes by chance: relative change of inverse depth per pixel at most."""
PRIOR_WEIGHT = 0.1
"""The extra cost of a plane far from the initial map: bare walls match everywhere and have to stay smooth."""
PRIOR_SHARE = 0.05
"""Relative difference of depth at which that has grown to about two thirds."""
MIN_SEEN = 0.6
"""Share of a patch's weight that a source has to see to have a vote."""


def refine_slanted(
    greys: np.ndarray,
    is_usable: np.ndarray,
    rig: CameraRig,
    *,
    camera: int,
    sources: list[int],
    seeds: np.ndarray,
    prior: np.ndarray,
    low: float,
    high: float,
    is_wanted: np.ndarray | None = None,
    n_scans: int = N_SCANS,
) -> tuple[np.ndarray, np.ndarray]:
    """Inverse depth of every pixel of one camera by slanted patches.

    Args:
        greys: White-balanced grey pictures of all cameras, 0..255. [C, H, W] float32
        is_usable: False where a background cannot be trusted. [C, H, W] bool
        rig: At the size of greys.
        seeds: Inverse depth maps to begin with; their slopes are tried too. [N, H, W]
        prior: Inverse depth that pixels without texture stay near. [H, W]
        low, high: Bounds of inverse depth.
        is_wanted: Pixels to be searched; the others keep what the first seed says and pass it on to their neighbours.
            None for all. [H, W] bool
        n_scans: Passes over the picture.
    Returns:
        inverse depth [H, W] float64, cost of its match [H, W] float64: about 0 to 1, UNKNOWN_COST where nothing can
        be said.
    """
    height, width = greys.shape[1:]
    planes = np.zeros((height, width, 3))
    planes[..., 0] = np.clip(prior, low, high)
    costs = np.full((height, width), np.inf)
    candidates = np.stack([_with_slopes(seed) for seed in seeds])
    is_wanted = np.ones((height, width), dtype=bool) if is_wanted is None else np.ascontiguousarray(is_wanted)
    planes[~is_wanted] = candidates[0][~is_wanted]
    costs[~is_wanted] = UNKNOWN_COST
    if not sources:
        return planes[..., 0], np.full((height, width), UNKNOWN_COST)
    pairs = [relative_homography(rig, camera, other) for other in sources]
    _search(
        greys[camera],
        np.ascontiguousarray(greys[sources]),
        np.ascontiguousarray(is_usable[sources]),
        np.stack([pair[0] for pair in pairs]),
        np.stack([pair[1] for pair in pairs]),
        candidates,
        is_wanted,
        n_scans,
        np.ascontiguousarray(prior, dtype=np.float64),
        low,
        high,
        planes,
        costs,
    )
    return planes[..., 0], costs


def _with_slopes(inverse: np.ndarray) -> np.ndarray:
    """Inverse depth and its slopes along x and y, per pixel. [H, W, 3]"""
    inverse = inverse.astype(np.float64)
    return np.stack([inverse, np.gradient(inverse, axis=1), np.gradient(inverse, axis=0)], axis=-1)


@njit(cache=True, nogil=True, error_model="numpy")
def _chance(state):
    """The next state of a generator (splitmix); `_unit` makes a number of it."""
    return state + np.uint64(0x9E3779B97F4A7C15)


@njit(cache=True, nogil=True, error_model="numpy")
def _unit(state):
    """A number in -1..1 from a state."""
    z = state
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return np.float64(z >> np.uint64(11)) / 4503599627370496.0 - 1.0


@njit(cache=True, nogil=True, error_model="numpy", fastmath=fast_math(*ALL))
def _source_cost(patch, source, is_usable, matrix, shift, x, y, plane):
    """1 - weighted ZNCC (+ grey difference) of a patch in one source; -1 without a vote."""
    own, weights, places, n, n_weight = patch
    inverse, slope_x, slope_y = plane[0], plane[1], plane[2]
    height, width = source.shape
    u, v = x + 0.5, y + 0.5
    base0 = matrix[0, 0] * u + matrix[0, 1] * v + matrix[0, 2] + shift[0] * inverse
    base1 = matrix[1, 0] * u + matrix[1, 1] * v + matrix[1, 2] + shift[1] * inverse
    base2 = matrix[2, 0] * u + matrix[2, 1] * v + matrix[2, 2] + shift[2] * inverse
    across0, down0 = matrix[0, 0] + shift[0] * slope_x, matrix[0, 1] + shift[0] * slope_y
    across1, down1 = matrix[1, 0] + shift[1] * slope_x, matrix[1, 1] + shift[1] * slope_y
    across2, down2 = matrix[2, 0] + shift[2] * slope_x, matrix[2, 1] + shift[2] * slope_y
    total, sum_s, sum_o, sum_ss, sum_oo, sum_so = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(n):
        i, j = places[k, 0], places[k, 1]
        w = base2 + across2 * i + down2 * j
        if w <= 1e-6:
            continue
        sx = (base0 + across0 * i + down0 * j) / w - 0.5
        sy = (base1 + across1 * i + down1 * j) / w - 0.5
        if not (sx >= 0 and sy >= 0 and sx < width - 1 and sy < height - 1):
            continue
        ix, iy = int(sx), int(sy)
        if not is_usable[iy, ix]:
            continue
        fx, fy = sx - ix, sy - iy
        top = source[iy, ix] * (1 - fx) + source[iy, ix + 1] * fx
        bottom = source[iy + 1, ix] * (1 - fx) + source[iy + 1, ix + 1] * fx
        grey = top * (1 - fy) + bottom * fy - 128.0
        weight, mine = weights[k], own[k]
        total += weight
        sum_s += weight * grey
        sum_o += weight * mine
        sum_ss += weight * grey * grey
        sum_oo += weight * mine * mine
        sum_so += weight * grey * mine
    if total < MIN_SEEN * n_weight:
        return -1.0
    mean_s, mean_o = sum_s / total, sum_o / total
    var_s, var_o = max(sum_ss / total - mean_s * mean_s, 0.0), max(sum_oo / total - mean_o * mean_o, 0.0)
    similarity = (sum_so / total - mean_s * mean_o) / (math.sqrt(var_s * var_o) + STD_FLOOR)
    difference = min(abs(mean_s - mean_o), GREY_TRUNCATION) / GREY_TRUNCATION
    return min(1.0 - similarity, 1.0) + GREY_WEIGHT * difference


@njit(cache=True, nogil=True, error_model="numpy")
def _plane_cost(patch, views, x, y, plane, prior, ranked):
    """Mean over the better half of the sources that have a vote, a lone one counting half, and the prior."""
    sources, are_usable, matrices, shifts = views
    n_votes = 0
    for s in range(len(sources)):
        cost = _source_cost(patch, sources[s], are_usable[s], matrices[s], shifts[s], x, y, plane)
        if cost >= 0:
            j = n_votes
            while j > 0 and ranked[j - 1] > cost:
                ranked[j] = ranked[j - 1]
                j -= 1
            ranked[j] = cost
            n_votes += 1
    if n_votes == 0:
        matched = UNKNOWN_COST
    elif n_votes == 1:
        matched = 0.5 * ranked[0] + 0.5
    else:
        half = (n_votes + 1) // 2
        matched = 0.0
        for j in range(half):
            matched += ranked[j]
        matched /= half
    away = (plane[0] / prior - 1.0) / PRIOR_SHARE
    return matched + PRIOR_WEIGHT * (1.0 - math.exp(-abs(away)))


@njit(cache=True, nogil=True, error_model="numpy")
def _gather(grey, x, y, own, weights, places):
    """Writes the greys, weights and offsets of a pixel's patch; returns how many there are and their weight."""
    height, width = grey.shape
    n, n_weight = 0, 0.0
    for j in range(-RADIUS_PX, RADIUS_PX + 1, STRIDE_PX):
        for i in range(-RADIUS_PX, RADIUS_PX + 1, STRIDE_PX):
            if 0 <= x + i < width and 0 <= y + j < height:
                apart = abs(grey[y + j, x + i] - grey[y, x])
                weights[n] = math.exp(-apart / EDGE_GREY_LEVELS - math.sqrt(float(i * i + j * j)) / RADIUS_PX)
                own[n] = grey[y + j, x + i] - 128.0
                places[n, 0], places[n, 1] = i, j
                n_weight += weights[n]
                n += 1
    return n, n_weight


@njit(cache=True, nogil=True, error_model="numpy")
def _anywhere(low, high, state, trial):
    """A plane by chance."""
    state = _chance(state)
    trial[0] = 0.5 * (low + high) + 0.5 * (high - low) * _unit(state)
    for m in range(1, 3):
        state = _chance(state)
        trial[m] = MAX_SLOPE * trial[0] * _unit(state)
    return state


@njit(cache=True, nogil=True, error_model="numpy")
def _shaken(plane, size, is_depth, is_slope, state, trial):
    """A plane near this one: another depth, another slope or both."""
    trial[:] = plane
    if is_depth:
        state = _chance(state)
        trial[0] += MAX_SLOPE * size * trial[0] * _unit(state)
    if is_slope:
        for m in range(1, 3):
            state = _chance(state)
            trial[m] += 0.5 * MAX_SLOPE * size * trial[0] * _unit(state)
    return state


@njit(cache=True, nogil=True, error_model="numpy")
def _search(grey, sources, are_usable, matrices, shifts, seeds, is_wanted, n_scans, prior, low, high, planes, costs):
    """Writes the plane [inverse depth, slope along x, slope along y] and the cost of every wanted pixel."""
    height, width = grey.shape
    side = 2 * (RADIUS_PX // STRIDE_PX) + 1
    own, weights, places = np.empty(side * side), np.empty(side * side), np.empty((side * side, 2))
    ranked, trial = np.empty(len(sources)), np.empty(3)
    for scan in range(n_scans + 1):
        step = 1 if scan % 2 == 0 else -1
        size = 0.5 ** max(scan - 1, 0)
        for row in range(height):
            y = row if step > 0 else height - 1 - row
            for column in range(width):
                x = column if step > 0 else width - 1 - column
                if not is_wanted[y, x]:
                    continue
                n, n_weight = _gather(grey, x, y, own, weights, places)
                patch = own, weights, places, n, n_weight
                views = sources, are_usable, matrices, shifts
                state = np.uint64((scan * height + y) * width + x) * np.uint64(0xD1342543DE82EF95)
                for t in range(len(seeds) + N_CHANCES if scan == 0 else N_NEIGHBORS + 3):
                    if scan == 0 and t < len(seeds):
                        trial[:] = seeds[t, y, x]
                    elif scan == 0:
                        state = _anywhere(low, high, state, trial)
                    elif (
                        t < N_NEIGHBORS
                    ):  # those that this scan has been at: next to it, above and diagonally, near and far
                        distance = step * (1 if t < 3 else FAR_PX)
                        dx = 0 if t % 3 == 1 else (distance if t % 3 == 0 else -distance)
                        dy = 0 if t % 3 == 0 else distance
                        if not (0 <= x - dx < width and 0 <= y - dy < height):
                            continue
                        trial[:] = planes[y - dy, x - dx]
                        trial[0] += dx * trial[1] + dy * trial[2]
                    else:
                        state = _shaken(planes[y, x], size, t != N_NEIGHBORS + 1, t != N_NEIGHBORS, state, trial)
                    if not (low <= trial[0] <= high):
                        continue
                    cost = _plane_cost(patch, views, x, y, trial, prior[y, x], ranked)
                    if cost < costs[y, x]:
                        costs[y, x] = cost
                        planes[y, x] = trial
