"""Light on what stands still: how much brighter or darker each static anchor is now than in the reference clip.

A shadow, a lamp or what a person reflects changes a surface for every camera that sees it. So each camera says, pixel
by pixel, how bright it finds what stands still; an anchor takes the median of the cameras that see it, and only where
most of them agree, which those that see a person in front of the surface do not. Neighbours are averaged. Changes as
small as the estimate errs are none, so that a surface on which nothing changes keeps its colours to the bit.

Brightness alone, no colour: with a colour per anchor, still pixels of cameras left out came out no better.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numba import njit
from scipy.spatial import KDTree

from engine.camera.projection import projection_matrices
from engine.camera.rig import CameraRig
from engine.cloud.background.exposure import BRIGHTEST, DARKEST, at_working_size
from engine.parallel import map_ordered, n_cores

WINDOW_FRAMES = 3
"""Light is measured where clips meet, from so many frames on either side: both clips find the same."""
MIN_CAMERAS = 3
AGREED_LOG = 0.03
"""Cameras agree within this of their median, log brightness."""
AGREED_SHARE = 0.6
N_NEIGHBORS = 24
MIN_KNOWN_SHARE = 0.25
"""Of the neighbours; where fewer are known nobody says anything, and nothing changes."""
NO_CHANGE = 0.005
"""Log brightness up to this is no change, twice this counts in full, in between there is no jump. Anchors of a real
capture scatter by 0.003 where nothing changes."""
LARGEST_LOG = 0.7
BEHIND_SHARE = 0.03
"""Anchors that lie further behind the nearest one, as a share of its depth, are hidden."""


def anchor_light(
    points: np.ndarray, rig: CameraRig, backgrounds: np.ndarray, frames_of: Callable[[int], Sequence[np.ndarray]]
) -> np.ndarray:
    """Log brightness of static anchors at one instant, against the backgrounds.

    Args:
        points: Static anchors, scene units. [A, 3]
        rig: Training cameras at full size.
        backgrounds: What they see while nothing moves. [C, H, W, 3] uint8
        frames_of: Camera row to some pictures around the instant, in the exposure of the backgrounds. [H, W, 3] uint8
    Returns:
        [A] float32, 0 where nothing changes or nobody can tell.
    """
    step = max(1, backgrounds.shape[2] // at_working_size(backgrounds[0]).shape[1])
    projections = projection_matrices(rig)

    def seen_by(row: int) -> np.ndarray:
        frames = frames_of(row)
        if not len(frames):
            return np.full(len(points), np.nan, np.float32)
        base = at_working_size(backgrounds[row]).mean(-1)
        now = np.median(np.stack([at_working_size(frame).mean(-1) for frame in frames]), axis=0)
        is_usable = (base > DARKEST) & (base < BRIGHTEST) & (now > DARKEST) & (now < BRIGHTEST)
        ratios = np.where(is_usable, np.log(np.maximum(now, 1.0) / np.maximum(base, 1.0)), np.nan).astype(np.float32)
        found = np.full(len(points), np.nan, np.float32)
        depths = np.full(base.shape, np.inf, np.float32)
        _sample(points, projections[row], float(step), ratios, depths, found)
        return found

    seen = np.stack(map_ordered(seen_by, range(len(rig))))  # [C, A]
    values, n_agreed = np.zeros(len(points), np.float32), np.zeros(len(points), np.float32)
    _agree(seen, np.empty(len(rig), np.float32), values, n_agreed)
    return _without_noise(_smooth(points, values, n_agreed))


@njit(cache=True, nogil=True, error_model="numpy")
def _sample(points, projection, step, ratios, depths, found):
    """Writes the ratio at each point that the camera sees unhidden by others. depths: scratch, infinite."""
    height, width = ratios.shape
    for is_second in range(2):
        for i in range(len(points)):
            p = points[i]
            z = projection[2, 0] * p[0] + projection[2, 1] * p[1] + projection[2, 2] * p[2] + projection[2, 3]
            if z <= 1e-6:
                continue
            x = (projection[0, 0] * p[0] + projection[0, 1] * p[1] + projection[0, 2] * p[2] + projection[0, 3]) / z
            y = (projection[1, 0] * p[0] + projection[1, 1] * p[1] + projection[1, 2] * p[2] + projection[1, 3]) / z
            if not (0.0 <= x < width * step and 0.0 <= y < height * step):
                continue
            column, row = int(x / step), int(y / step)
            if is_second:
                if z <= depths[row, column] * (1.0 + BEHIND_SHARE):
                    found[i] = ratios[row, column]
                continue
            for near_row in range(max(row - 1, 0), min(row + 2, height)):
                for near_column in range(max(column - 1, 0), min(column + 2, width)):
                    depths[near_row, near_column] = min(depths[near_row, near_column], z)


@njit(cache=True, nogil=True, error_model="numpy")
def _agree(seen, ranked, values, n_agreed):
    """Writes the median over the cameras where most of them agree with it, and how many do; else both stay 0."""
    n_cameras, n_points = seen.shape
    for i in range(n_points):
        n = 0
        for camera in range(n_cameras):
            value = seen[camera, i]
            if value == value:
                j = n
                while j > 0 and ranked[j - 1] > value:
                    ranked[j] = ranked[j - 1]
                    j -= 1
                ranked[j] = value
                n += 1
        if n < MIN_CAMERAS:
            continue
        median = 0.5 * (ranked[(n - 1) // 2] + ranked[n // 2])
        agreed = 0
        total = 0.0
        for j in range(n):
            if abs(ranked[j] - median) <= AGREED_LOG:
                agreed += 1
                total += ranked[j]
        if agreed >= MIN_CAMERAS and agreed >= AGREED_SHARE * n:
            values[i] = total / agreed
            n_agreed[i] = agreed


def _smooth(points: np.ndarray, values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Weighted mean over the nearest anchors; 0 where too few of them are known. [A] float32"""
    n_neighbors = min(N_NEIGHBORS, len(points))
    _, near = KDTree(points).query(points, k=n_neighbors, workers=n_cores())
    near = near.reshape(len(points), n_neighbors)
    total = weights[near].sum(1)
    means = (values * weights)[near].sum(1) / np.maximum(total, 1e-9)
    is_known = (weights[near] > 0).mean(1) >= MIN_KNOWN_SHARE
    return np.where(is_known, means, 0.0).astype(np.float32)


def _without_noise(logs: np.ndarray) -> np.ndarray:
    size = np.minimum(np.abs(logs), LARGEST_LOG)
    return (np.sign(logs) * np.clip(2.0 * (size - NO_CHANGE), 0.0, size)).astype(np.float32)
