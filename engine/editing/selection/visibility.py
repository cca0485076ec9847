"""Which Gaussians can be seen from a view, and which hide behind others: two compiled passes over a small picture.

The first pass goes from front to back and finds how far one sees in each pixel: to where half of the light is stopped.
The second asks of every Gaussian whether it reaches that far somewhere. What lies in the very surface that is seen
counts as seen, what lies behind it does not.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from engine.conventions import ALPHA_MAX, ALPHA_MIN, EPS2D_PX2
from engine.editing.selection.projected import ProjectedGaussians
from engine.editing.selection.seen_from import SeenFrom

PICTURE_PX = 60_000
"""Pixels of the picture in which it is looked, at most."""
SEEN_TRANSMITTANCE = 0.5
"""A surface is seen where it stops half of the light."""
DEPTH_SIGMAS = 2.0
"""A Gaussian is as thick as this in the direction of view, standard deviations to either side."""
DEPTH_SHARE = 2e-3
"""Depths that differ by less than this share of the distance are the same."""
CORE_SHARE = 0.3
"""A Gaussian has to be seen where its alpha is this share of its largest; its faint rim does not count."""


def seen_rows(projected: ProjectedGaussians, opacities: np.ndarray) -> np.ndarray:
    """Which Gaussians can be seen somewhere in the picture. [N] bool

    Args:
        opacities: In 0..1. [N]
    """
    view = projected.view
    scale, width, height = small_picture(view)
    opacities = np.ascontiguousarray(opacities, np.float64)
    found = np.zeros(len(projected), np.bool_)
    rows = np.flatnonzero(projected.is_before & (opacities >= ALPHA_MIN))
    order = rows[np.argsort(projected.depths[rows])]
    stops = np.full((height, width), np.inf)
    left = np.ones((height, width))
    arrays = (projected.centers, projected.depths, projected.spreads)
    _stop_light(*arrays, opacities, order, scale, stops, left)
    _find_seen(*arrays, order, scale, view.set_back, stops, found)
    return found


def small_picture(view: SeenFrom) -> tuple[float, int, int]:
    """The picture in which it is looked: pixels of it per pixel of the view, its width and its height."""
    scale = min(float(np.sqrt(PICTURE_PX / (view.width * view.height))), 1.0)
    return scale, max(int(np.ceil(view.width * scale)), 1), max(int(np.ceil(view.height * scale)), 1)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def footprint(centers, spreads, reach, i, scale, height, width):
    """Place, inverse spread, slope of depth, thickness, and first and last pixel of a Gaussian in the small picture.

    reach: How far it is looked at, standard deviations.
    """
    u, v = scale * centers[i, 0], scale * centers[i, 1]
    xx, xy = scale * scale * spreads[i, 0] + EPS2D_PX2, scale * scale * spreads[i, 1]
    yy = scale * scale * spreads[i, 2] + EPS2D_PX2
    xz, yz = scale * spreads[i, 3], scale * spreads[i, 4]
    area = xx * yy - xy * xy
    if not 0.0 < area < np.inf:  # so wide, or so thin, that float64 does not suffice: it is nowhere
        return u, v, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0, -1, 0, -1
    inverse = 1.0 / area
    ixx, ixy, iyy = inverse * yy, -inverse * xy, inverse * xx
    slope_x, slope_y = ixx * xz + ixy * yz, ixy * xz + iyy * yz
    thickness = DEPTH_SIGMAS * np.sqrt(max(spreads[i, 5] - xz * slope_x - yz * slope_y, 0.0))
    half_x, half_y = reach * np.sqrt(xx), reach * np.sqrt(yy)
    first_x, last_x = int(max(np.ceil(u - half_x - 0.5), 0.0)), int(min(np.floor(u + half_x - 0.5), width - 1.0))
    first_y, last_y = int(max(np.ceil(v - half_y - 0.5), 0.0)), int(min(np.floor(v + half_y - 0.5), height - 1.0))
    return u, v, ixx, ixy, iyy, slope_x, slope_y, thickness, first_x, last_x, first_y, last_y


@njit(cache=True, nogil=True, error_model="numpy")
def _stop_light(centers, depths, spreads, opacities, order, scale, stops, left):
    height, width = stops.shape
    for k in range(len(order)):
        i = order[k]
        limit = np.log(opacities[i] / ALPHA_MIN)
        u, v, ixx, ixy, iyy, slope_x, slope_y, thickness, first_x, last_x, first_y, last_y = footprint(
            centers, spreads, np.sqrt(2.0 * limit), i, scale, height, width
        )
        for row in range(first_y, last_y + 1):
            dy = row + 0.5 - v
            for column in range(first_x, last_x + 1):
                if left[row, column] <= SEEN_TRANSMITTANCE:
                    continue
                dx = column + 0.5 - u
                power = 0.5 * (ixx * dx * dx + iyy * dy * dy) + ixy * dx * dy
                if power > limit:
                    continue
                alpha = opacities[i] * np.exp(-power)
                left[row, column] *= 1.0 - min(alpha, ALPHA_MAX)
                if left[row, column] <= SEEN_TRANSMITTANCE:
                    stops[row, column] = depths[i] + slope_x * dx + slope_y * dy + thickness


@njit(cache=True, nogil=True, error_model="numpy")
def _find_seen(centers, depths, spreads, order, scale, set_back, stops, found):
    height, width = stops.shape
    core = -2.0 * np.log(CORE_SHARE)
    for k in range(len(order)):
        i = order[k]
        u, v, ixx, ixy, iyy, slope_x, slope_y, thickness, first_x, last_x, first_y, last_y = footprint(
            centers, spreads, np.sqrt(core), i, scale, height, width
        )
        same = DEPTH_SHARE * max(depths[i] - set_back, 0.0)
        for row in range(first_y, last_y + 1):
            dy = row + 0.5 - v
            for column in range(first_x, last_x + 1):
                dx = column + 0.5 - u
                if ixx * dx * dx + iyy * dy * dy + 2.0 * ixy * dx * dy > core:
                    continue
                if depths[i] + slope_x * dx + slope_y * dy - thickness <= stops[row, column] + same:
                    found[i] = True
                    break
            if found[i]:
                break
