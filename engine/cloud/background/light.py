"""Light on what stands still: how much brighter or darker each static anchor is now than in the reference clip.

A shadow, a lamp or what a person reflects changes a surface for every camera that sees it. So each camera says, pixel
by pixel, how bright it finds what stands still; an anchor takes the median of the cameras that see it, and only where
most of them agree, which those that see a person in front of the surface do not. Neighbours are averaged. Changes too
small to be sure of are dropped, so that a surface on which nothing changes keeps its colours to the bit.

Brightness alone, no colour: with a colour per anchor, still pixels of cameras left out came out no better.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numba import njit
from scipy.spatial import KDTree

from engine.camera.projection import projection_matrices
from engine.camera.rig import CameraRig
from engine.cloud.background.exposure import BRIGHTEST, DARKEST, at_working_size, without_smallest
from engine.parallel import map_ordered, n_cores

WINDOW_FRAMES = 3
"""Light is measured where clips meet, on either side from so many frames: both clips find the same."""
MIN_CAMERAS = 3
AGREED_LOG = 0.03
"""Cameras agree within this of their median, log brightness."""
AGREED_SHARE = 0.6
N_NEIGHBORS = 24
ALIKE_LOG = 0.05
"""Neighbours that differ by more than this lie in another light; an anchor alone scatters by 0.015."""
MIN_KNOWN_SHARE = 0.25
"""Of the neighbours; where fewer are known, the brightness is left as it was."""
NO_CHANGE = 0.005
"""Log brightness up to this counts as unchanged, twice this counts in full, and nothing jumps in between. Anchors of a
real capture scatter by 0.003 where nothing changes."""
LARGEST_LOG = 0.7
JUMP_LOG = 0.02
"""Instants that differ by more than this differ in truth."""
HIDDEN = -1
BEHIND_SHARE = 0.03
"""Anchors that lie further behind the nearest one, as a share of its depth, are hidden."""


class AnchorLight:
    """Measures the light on static anchors at any instant, against the backgrounds.

    Args:
        points: Static anchors, scene units. [A, 3]
        rig: Training cameras at full size.
        backgrounds: Their pictures while nothing moves. [C, H, W, 3] uint8
    """

    def __init__(self, points: np.ndarray, rig: CameraRig, backgrounds: np.ndarray) -> None:
        self._base = [at_working_size(background).mean(-1) for background in backgrounds]
        step = backgrounds.shape[2] // self._base[0].shape[1]
        projections, n_points = projection_matrices(rig), len(points)

        def pixels_of(row: int) -> np.ndarray:
            pixels = np.full(n_points, HIDDEN, np.int64)
            depths = np.full(self._base[row].shape, np.inf)
            _visible_pixels(points, projections[row], float(step), depths, pixels)
            return pixels

        self._pixels = map_ordered(pixels_of, range(len(rig)))
        n_neighbors = min(N_NEIGHBORS, n_points)
        self._near = KDTree(points).query(points, k=n_neighbors, workers=n_cores())[1].reshape(n_points, n_neighbors)

    def at(self, frames_of: Callable[[int], Sequence[np.ndarray]]) -> np.ndarray:
        """Log brightness of the anchors.

        Args:
            frames_of: Camera row to some pictures around the instant, in the exposure of the backgrounds. [H, W, 3]
                uint8 each
        Returns:
            [A] float32, 0 where nothing changes or nobody can tell.
        """
        n_cameras, n_points = len(self._base), len(self._near)

        def seen_by(row: int) -> np.ndarray:
            base, frames = self._base[row], frames_of(row)
            if not len(frames):
                return np.full(n_points, np.nan, np.float32)
            now = np.median(np.stack([at_working_size(frame).mean(-1) for frame in frames]), axis=0)
            is_usable = (base > DARKEST) & (base < BRIGHTEST) & (now > DARKEST) & (now < BRIGHTEST)
            ratios = np.where(is_usable, np.log(np.maximum(now, 1.0) / np.maximum(base, 1.0)), np.nan)
            pixels = self._pixels[row]
            return np.where(pixels == HIDDEN, np.nan, ratios.reshape(-1)[pixels]).astype(np.float32)

        seen = np.stack(map_ordered(seen_by, range(n_cameras)))  # [C, A]
        values, n_agreed = np.zeros((2, n_points), np.float32)
        _agree(seen, np.empty(n_cameras, np.float32), values, n_agreed)
        smooth = np.clip(_smooth(self._near, values, n_agreed), -LARGEST_LOG, LARGEST_LOG)
        return without_smallest(smooth, NO_CHANGE).astype(np.float32)


def joined(beside: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Light where two clips meet: the mean of both sides, so that nothing jumps; a real jump, as of a lamp that is
    switched, stays one.

    Args:
        beside, own: Log brightness on the far and on the near side of the border. [A]
    """
    return np.where(_differs(beside - own), own, (beside + own) / 2)


def taken_over(before: np.ndarray, own: np.ndarray) -> np.ndarray:
    """`joined` where the clip before could not look ahead, so that it ends in its own light."""
    return np.where(_differs(before - own), own, before)


def met_by_plain(own: np.ndarray) -> np.ndarray:
    """`joined` where the clip on the other side cannot move half way, since its light is always 0."""
    return np.where(_differs(own), own, np.float32(0.0))


def steady(first: np.ndarray, half_way: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Light at the start and the end of a clip, where it goes evenly from one to the other: there half way agrees.

    Elsewhere, as under a lamp that is switched on in between, what has to change is left to anchors that move: only as
    much counts as there is at all three instants.

    Args:
        first, half_way, last: Log brightness. [A]
    Returns:
        [A, 2]
    """
    at_all = np.stack([first, half_way, last])
    is_even = ~_differs(half_way - (first + last) / 2)
    least = np.where((at_all > 0).all(0), at_all.min(0), np.where((at_all < 0).all(0), at_all.max(0), 0.0))
    return np.stack([np.where(is_even, first, least), np.where(is_even, last, least)], axis=1).astype(first.dtype)


def _differs(change: np.ndarray) -> np.ndarray:
    return np.abs(change) >= JUMP_LOG


@njit(cache=True, nogil=True, error_model="numpy")
def _visible_pixels(points, projection, step, depths, pixels):
    """Writes in which working pixel each point lies that the camera sees unhidden by others. depths: infinite."""
    height, width = depths.shape
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
                    pixels[i] = row * width + column
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


def _smooth(near: np.ndarray, values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Weighted mean over the nearest anchors that differ little; 0 where too few of them are known. [A] float32

    Edges of a shadow stay edges: smeared, they would be a light that explains half of them.
    """
    around, of_each = values[near], weights[near]
    is_like = (np.abs(around - values[:, None]) < ALIKE_LOG) | (weights == 0)[:, None]
    is_known = (of_each > 0).mean(1) >= MIN_KNOWN_SHARE
    of_each = of_each * is_like
    means = (around * of_each).sum(1) / np.maximum(of_each.sum(1), 1e-9)
    return np.where(is_known, means, 0.0).astype(np.float32)
