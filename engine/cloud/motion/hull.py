"""Visual hull of one frame: the voxels that every camera's motion mask allows, carved coarse to fine.

Owns occupancy, surface, visibility and colour of one frame's hull. Fusing frames is engine.cloud.motion.moving_cloud.
Source: Laurentini 1994. A hull is an upper bound of the object; one camera may disagree (mask holes), and enough
cameras have to agree, so that places few cameras look at do not fill up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from engine.cloud.median import median_over_cameras
from engine.parallel import map_ordered, row_spans

BLOCK = 8
"""Voxels along a coarse block's edge."""
COLOR_SLACK_VOXELS = 2.0
"""A surface voxel this far behind the hull's nearest surface in a camera still counts as seen by it."""


@dataclass(frozen=True, slots=True)
class Grid:
    """A box of cubic voxels. origin [3] is its lowest corner; size the voxel edge; n_blocks [3] of BLOCK^3 voxels."""

    origin: np.ndarray
    size: float
    n_blocks: np.ndarray

    @staticmethod
    def over(bounds_min: np.ndarray, bounds_max: np.ndarray, size: float) -> Grid:
        """The grid that covers the bounds. Its corners are multiples of `size`: two clips share one lattice."""
        origin = np.floor(np.asarray(bounds_min, dtype=np.float64) / size) * size
        extent = np.asarray(bounds_max, dtype=np.float64) - origin
        n_blocks = np.maximum(np.ceil(extent / (size * BLOCK)), 1).astype(np.int64)
        return Grid(origin, float(size), n_blocks)

    @property
    def shape(self) -> np.ndarray:
        """Voxels along each axis. [3] int64"""
        return self.n_blocks * BLOCK

    def centers(self, voxels: np.ndarray) -> np.ndarray:
        """World centres of integer voxels [P, 3]."""
        return self.origin + (voxels + 0.5) * self.size


def carve(
    masks: np.ndarray,
    projections: np.ndarray,
    grid: Grid,
    *,
    near: float,
    n_misses: int,
    min_hits: int,
    is_valid: np.ndarray | None = None,
) -> np.ndarray:
    """Voxels of the hull.

    Args:
        masks: Motion masks of one frame. [C, H, W] bool
        projections: K [R | t] at mask size. [C, 3, 4]
        near: Points nearer than this to a camera are not judged by it, scene units.
        n_misses: Cameras that see the voxel outside their mask and are outvoted.
        min_hits: Cameras that have to see the voxel inside their mask.
        is_valid: Pixels that the cameras see, None for all: of a voxel that falls elsewhere, as of one outside the
            picture, a camera says nothing. [C, H, W] bool
    Returns:
        Integer voxels, sorted by block and then x, y, z. [P, 3] int64
    """
    integrals = _integrated(masks)
    blind = _integrated(~is_valid) if is_valid is not None else np.zeros((0, 1, 1), np.int32)
    blocks = np.stack(np.meshgrid(*(np.arange(n) for n in grid.n_blocks), indexing="ij"), axis=-1).reshape(-1, 3)
    arguments = (integrals, blind, projections, grid.origin, grid.size, near, n_misses, min_hits)
    # |d pixel| <= |d point| (|row| + |pixel| |row2|) / depth; rows of K R bound the footprint without knowing K
    rows = np.sqrt((projections[:, :, :3] ** 2).sum(-1))
    footprints = np.maximum(rows[:, 0], rows[:, 1]) + max(masks.shape[1:]) * rows[:, 2]
    is_kept = np.zeros(len(blocks), dtype=bool)

    def coarse(span: tuple[int, int]) -> None:
        part = slice(*span)
        _carve_blocks(blocks[part], *arguments, footprints, is_kept[part])

    map_ordered(coarse, row_spans(len(blocks)))
    blocks = blocks[is_kept]
    if len(blocks) == 0:
        return np.zeros((0, 3), dtype=np.int64)

    def fine(span: tuple[int, int]) -> np.ndarray:
        part = blocks[slice(*span)]
        found = np.empty((len(part) * BLOCK**3, 3), np.int64)
        return found[: _carve_voxels(part, *arguments, found)].copy()

    return np.concatenate(map_ordered(fine, row_spans(len(blocks))))


def surface_rows(voxels: np.ndarray, grid: Grid) -> np.ndarray:
    """Voxels with at least one of their six neighbours empty. bool [P]"""
    if len(voxels) == 0:
        return np.zeros(0, dtype=bool)
    low = voxels.min(0) - 1
    occupied = np.zeros(voxels.max(0) - low + 2, dtype=bool)
    local = voxels - low
    occupied[tuple(local.T)] = True
    is_surface = np.zeros(len(voxels), dtype=bool)
    for axis in range(3):
        for step in (-1, 1):
            neighbor = local.copy()
            neighbor[:, axis] += step
            is_surface |= ~occupied[tuple(neighbor.T)]
    return is_surface


def hull_visibility(
    points: np.ndarray, size: float, masks: np.ndarray, projections: np.ndarray, *, near: float
) -> tuple[np.ndarray, np.ndarray]:
    """Where surface voxels fall in each picture, and whether the hull itself hides them there.

    Args:
        points: Centres of all surface voxels of one frame. [P, 3]
        size: Voxel edge, scene units.
        masks: Motion masks of that frame. [C, H, W] bool
    Returns:
        pixel: Flat pixel index inside the camera's mask, -1 if not seen. [C, P] int64
        is_visible: Seen, and not more than COLOR_SLACK_VOXELS behind the hull's nearest surface. [C, P] bool
    """

    height, width = masks.shape[1:]
    shrink = max(1, width // 160)  # of the buffer for the depth test
    rows, thirds = projections[:, 0, :3], projections[:, 2, :3]
    squares = (rows * rows).sum(-1) - (rows * thirds).sum(-1) ** 2
    focals = np.sqrt(np.maximum(squares, 1e-12))  # |K R row 0| without its cx part
    pixel = np.full((len(masks), len(points)), -1, np.int64)
    is_visible = np.zeros(pixel.shape, dtype=bool)

    def see(camera: int) -> None:
        nearest = np.full((-(-height // shrink), -(-width // shrink)), np.inf)
        view = projections[camera], near, focals[camera], shrink, nearest, np.empty(len(points))
        _see_points(points, size, masks[camera], *view, pixel[camera], is_visible[camera])

    map_ordered(see, range(len(masks)))
    return pixel, is_visible


def hull_colors(pictures: np.ndarray, pixel: np.ndarray, is_visible: np.ndarray, gains: np.ndarray) -> np.ndarray:
    """Median white-balanced colour of surface voxels over the cameras that see them.

    Cameras for which the hull hides the voxel are left out unless no other is left.

    Args:
        pictures: One frame of every camera. [C, H, W, 3] uint8
        pixel, is_visible: From hull_visibility. [C, P]
        gains: camera_colour = gain * scene_colour. [C, 3]
    Returns:
        0..255, NaN where no mask contains the voxel. [P, 3] float32
    """
    is_used = (pixel >= 0) & (is_visible | ~is_visible.any(axis=0))
    samples = np.full((*pixel.shape, 3), np.nan, dtype=np.float32)
    for camera, picture in enumerate(pictures):
        rows = is_used[camera]
        samples[camera, rows] = picture.reshape(-1, 3)[pixel[camera, rows]] / gains[camera]
    return median_over_cameras(samples)


def _integrated(masks: np.ndarray) -> np.ndarray:
    """Of each mask the sums over all pixels left of and above each corner. [C, H + 1, W + 1] int32"""
    sums = np.zeros((len(masks), masks.shape[1] + 1, masks.shape[2] + 1), np.int32)
    map_ordered(lambda camera: _integrate(masks[camera], sums[camera]), range(len(masks)))
    return sums


@njit(cache=True, nogil=True, error_model="numpy")
def _integrate(mask, sums):
    """Writes sums of the mask over all pixels left of and above each corner. [H + 1, W + 1], zeros before"""
    height, width = mask.shape
    for y in range(height):
        run = 0
        for x in range(width):
            run += mask[y, x]
            sums[y + 1, x + 1] = sums[y, x + 1] + run


@njit(nogil=True, error_model="numpy")
def _box_has_any(integrals, camera, x, y, radius):
    """Any set pixel whose area the square around (x, y) touches, after cutting it to the picture."""
    height, width = integrals.shape[1] - 1, integrals.shape[2] - 1
    x0, x1 = min(max(math.floor(x - radius), 0), width), min(max(math.floor(x + radius) + 1, 0), width)
    y0, y1 = min(max(math.floor(y - radius), 0), height), min(max(math.floor(y + radius) + 1, 0), height)
    total = integrals[camera, y1, x1] - integrals[camera, y0, x1]
    return total - integrals[camera, y1, x0] + integrals[camera, y0, x0] > 0


@njit(cache=True, nogil=True, error_model="numpy")
def _carve_blocks(blocks, integrals, blind, p, origin, size, near, n_misses, min_hits, footprints, is_kept):
    """Blocks that may hold a hull voxel: conservative, a block is dropped only if every voxel of it would be."""
    height, width = integrals.shape[1] - 1, integrals.shape[2] - 1
    edge = size * BLOCK
    ball = 0.5 * math.sqrt(3.0) * edge
    for b in range(len(blocks)):
        px = origin[0] + (blocks[b, 0] + 0.5) * edge
        py = origin[1] + (blocks[b, 1] + 0.5) * edge
        pz = origin[2] + (blocks[b, 2] + 0.5) * edge
        misses, hits = 0, 0
        for c in range(len(p)):
            depth = p[c, 2, 0] * px + p[c, 2, 1] * py + p[c, 2, 2] * pz + p[c, 2, 3]
            if depth + ball < near:
                continue
            if depth - ball < 0.5 * near:
                hits += 1  # too close to bound: may be seen
                continue
            x = (p[c, 0, 0] * px + p[c, 0, 1] * py + p[c, 0, 2] * pz + p[c, 0, 3]) / depth
            y = (p[c, 1, 0] * px + p[c, 1, 1] * py + p[c, 1, 2] * pz + p[c, 1, 3]) / depth
            radius = ball * footprints[c] / (depth - ball) + 2.0
            if x + radius < 0 or y + radius < 0 or x - radius > width or y - radius > height:
                continue
            if _box_has_any(integrals, c, x, y, radius):
                hits += 1
                continue
            is_inside = x - radius >= 0 and y - radius >= 0 and x + radius <= width and y + radius <= height
            if is_inside and depth - ball > near and not (len(blind) and _box_has_any(blind, c, x, y, radius)):
                misses += 1
                if misses > n_misses:
                    break
        is_kept[b] = misses <= n_misses and hits >= min_hits


@njit(cache=True, nogil=True, error_model="numpy")
def _carve_voxels(blocks, integrals, blind, p, origin, size, near, n_misses, min_hits, found):
    """Writes voxels of the hull and returns how many there are."""
    height, width = integrals.shape[1] - 1, integrals.shape[2] - 1
    n_found = 0
    for b in range(len(blocks)):
        for i in range(BLOCK):
            for j in range(BLOCK):
                for k in range(BLOCK):
                    vx, vy, vz = blocks[b, 0] * BLOCK + i, blocks[b, 1] * BLOCK + j, blocks[b, 2] * BLOCK + k
                    px = origin[0] + (vx + 0.5) * size
                    py = origin[1] + (vy + 0.5) * size
                    pz = origin[2] + (vz + 0.5) * size
                    misses, hits = 0, 0
                    for c in range(len(p)):
                        depth = p[c, 2, 0] * px + p[c, 2, 1] * py + p[c, 2, 2] * pz + p[c, 2, 3]
                        if depth < near:
                            continue
                        x = (p[c, 0, 0] * px + p[c, 0, 1] * py + p[c, 0, 2] * pz + p[c, 0, 3]) / depth
                        y = (p[c, 1, 0] * px + p[c, 1, 1] * py + p[c, 1, 2] * pz + p[c, 1, 3]) / depth
                        if x < 0 or y < 0 or x >= width or y >= height:
                            continue
                        if len(blind) and _box_has_any(blind, c, x, y, 0.0):
                            continue
                        if _box_has_any(integrals, c, x, y, 1.0):
                            hits += 1
                        else:
                            misses += 1
                            if misses > n_misses:
                                break
                    if misses <= n_misses and hits >= min_hits:
                        found[n_found, 0], found[n_found, 1], found[n_found, 2] = vx, vy, vz
                        n_found += 1
    return n_found


@njit(cache=True, nogil=True, error_model="numpy")
def _see_points(points, size, mask, projection, near, focal, shrink, nearest, depths, pixel, is_visible):
    """Writes pixels inside the mask, and a depth test against the splatted hull (buffer about 160 wide)."""
    height, width = mask.shape
    small_h, small_w = nearest.shape
    n_points = len(points)
    for i in range(n_points):
        a, b, c = points[i, 0], points[i, 1], points[i, 2]
        depth = projection[2, 0] * a + projection[2, 1] * b + projection[2, 2] * c + projection[2, 3]
        depths[i] = depth
        if depth < near:
            continue
        x = (projection[0, 0] * a + projection[0, 1] * b + projection[0, 2] * c + projection[0, 3]) / depth
        y = (projection[1, 0] * a + projection[1, 1] * b + projection[1, 2] * c + projection[1, 3]) / depth
        if x < 0 or y < 0 or x >= width or y >= height:
            continue
        pixel[i] = int(y) * width + int(x)
        radius = 0.5 * size * focal / depth
        x0, x1 = max(int((x - radius) / shrink), 0), min(int((x + radius) / shrink), small_w - 1)
        y0, y1 = max(int((y - radius) / shrink), 0), min(int((y + radius) / shrink), small_h - 1)
        for v in range(y0, y1 + 1):
            for u in range(x0, x1 + 1):
                if depth < nearest[v, u]:
                    nearest[v, u] = depth
    for i in range(n_points):
        if pixel[i] < 0:
            continue
        y, x = pixel[i] // width, pixel[i] % width
        if not mask[y, x]:
            pixel[i] = -1
            continue
        slack = COLOR_SLACK_VOXELS * size + shrink * depths[i] / focal  # one buffer cell of a 45 degree slope
        is_visible[i] = depths[i] <= nearest[y // shrink, x // shrink] + slack
