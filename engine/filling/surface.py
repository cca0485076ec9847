"""New Gaussians for holes: discs on the surfaces that go on behind what was taken away, the same for all cameras."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import KDTree

from engine.camera.rotations import quats_of
from engine.cloud.voxel import voxel_keys, voxel_means
from engine.editing.fills.fill import MAX_FILLED, FillGaussians
from engine.filling.continuing import continued_colors, continued_depth
from engine.filling.pictures import COVERED, DEPTH_TOLERANCE, Taken, pixels_of, points_at
from engine.images.image_filters import dilate

BEFORE_SURFACES = 0.06
"""A new point that lies by this share before a surface that a camera sees would hide it: it floats in the air."""
MAX_HIDING = 1
"""So many pictures may disagree; surfaces are uncertain at their edges."""
RIM_PX = 2
"""Pixels around a hole that still show something of what was taken away."""
N_NEIGHBOURS, N_THINNED = 32, 2
"""Points that say where the surface is, and how often they are asked."""
OPACITY = 0.97
WIDTH = 0.7
"""Standard deviation of a disc in its plane, in edges of a cell: neighbours overlap."""
THICKNESS = 0.1
"""Of a disc, in edges of a cell."""


def surface_behind(pictures: Sequence[Taken], holes: Sequence[np.ndarray], cell: float) -> FillGaussians:
    """Discs that close holes.

    Args:
        pictures: All cameras at all moments.
        holes: Of each. [H, W] bool
        cell: Discs are at least this far apart, scene units.
    """
    kept = _Points([], [], [], [])
    for one, is_hole in zip(pictures, holes, strict=True):
        if is_hole.any():
            _continue(one, is_hole, kept)
    points, normals, colors, sizes = kept.joined()
    is_clear = _n_hiding(points, pictures, holes) <= MAX_HIDING
    points, normals, colors, sizes = points[is_clear], normals[is_clear], colors[is_clear], sizes[is_clear]
    if not len(points):
        return _discs(points, normals, colors, np.zeros(0, bool), cell)
    cell = max(cell, float(np.median(sizes)))
    while len(np.unique(voxel_keys(points, cell))) > MAX_FILLED:
        cell *= 1.3
    means, (mean_normals, mean_colors), n_points = voxel_means(points, cell, [normals, colors], np.ones(len(points)))
    for _ in range(N_THINNED):
        means, mean_normals, mean_colors = _thinned(means, mean_normals, mean_colors, n_points)
    means, (mean_normals, mean_colors), _ = voxel_means(means, cell, [mean_normals, mean_colors], n_points)
    seen_colors = _seen_colors(means, pictures)
    is_guess = np.isnan(seen_colors[:, 0])
    return _discs(means, mean_normals, np.where(is_guess[:, None], mean_colors, seen_colors), is_guess, cell)


def _thinned(
    points: np.ndarray, normals: np.ndarray, colors: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points on the planes through their neighbours, with the mean colours of these: cameras continue surfaces a little
    differently, and together they give a thick one."""
    k = min(N_NEIGHBOURS, len(points))
    _, near = KDTree(points).query(points, k)
    near = near.reshape(len(points), k)
    share = weights[near] / weights[near].sum(1, keepdims=True)
    centers = (points[near] * share[..., None]).sum(1)
    away = points[near] - centers[:, None]
    across = np.linalg.eigh(np.einsum("nk,nki,nkj->nij", share, away, away))[1][..., 0]
    across = np.where(((across * normals).sum(1) < 0)[:, None], -across, across)
    moved = points - ((points - centers) * across).sum(1, keepdims=True) * across
    return moved, across, (colors[near] * share[..., None]).sum(1)


class _Points:
    """Points of holes, picture by picture."""

    def __init__(self, *columns: list[np.ndarray]) -> None:
        self._columns = columns

    def add(self, *columns: np.ndarray) -> None:
        """Those of one picture."""
        for known, column in zip(self._columns, columns, strict=True):
            known.append(column)

    def joined(self) -> tuple[np.ndarray, ...]:
        """Points [P, 3], normals [P, 3], colours [P, 3], widths of their pixels [P]."""
        widths = ((3,), (3,), (3,), ())
        return tuple(
            np.concatenate([np.zeros((0, *width)), *column])
            for width, column in zip(widths, self._columns, strict=True)
        )


def _continue(one: Taken, is_hole: np.ndarray, kept: _Points) -> None:
    after = one.after
    is_hole = dilate(is_hole, RIM_PX)
    depth = continued_depth(np.where(after.alpha >= COVERED, after.depth, 0.0), is_hole)
    colors = continued_colors(after.image, is_hole)
    is_found = is_hole & np.isfinite(depth)
    whole = np.where(is_hole, depth, after.depth)
    normals = _normals(one, whole)[is_found]
    sizes = whole[is_found] / one.view.K[0, 0]
    kept.add(points_at(one.view, whole, is_found), normals, colors[is_found], sizes)


def _normals(one: Taken, depth: np.ndarray) -> np.ndarray:
    """Normals of the surfaces that pixels show, towards the camera. [H, W, 3]"""
    filled = np.where(np.isfinite(depth) & (depth > 0), depth, np.nan)
    points = points_at(one.view, filled, np.ones(depth.shape, bool)).reshape(*depth.shape, 3)
    with np.errstate(invalid="ignore"):
        normals = np.cross(np.gradient(points, axis=1), np.gradient(points, axis=0))
        lengths = np.linalg.norm(normals, axis=-1, keepdims=True)
    to_camera = -one.view.world_to_camera[2, :3]
    is_known = np.isfinite(lengths) & (lengths > 0)
    normals = np.where(is_known, normals / np.where(is_known, lengths, 1.0), to_camera)
    return np.where((normals @ to_camera)[..., None] < 0, -normals, normals)


def _n_hiding(points: np.ndarray, pictures: Sequence[Taken], holes: Sequence[np.ndarray]) -> np.ndarray:
    """In how many pictures each point would hide a surface that is seen there, or the darkness where nothing is. [P]"""
    n = np.zeros(len(points), np.int64)
    for one, is_hole in zip(pictures, holes, strict=True):
        rows, columns, depth = pixels_of(one.view, points)
        is_surface = (one.after.alpha >= COVERED) & ~dilate(is_hole, RIM_PX)
        surface = np.where(is_surface, one.after.depth, 0.0)
        is_dark = (one.before.alpha < COVERED) & ~dilate(one.is_open, RIM_PX)
        surface = np.where(is_dark, np.inf, surface)[rows, columns]
        n += depth < surface * (1.0 - BEFORE_SURFACES)
    return n


def _seen_colors(points: np.ndarray, pictures: Sequence[Taken]) -> np.ndarray:
    """Colours of points that a camera sees while nothing is taken away, NaN for the others. [P, 3]"""
    colors = np.full((len(pictures), len(points), 3), np.nan, np.float32)
    for found, one in zip(colors, pictures, strict=True):
        rows, columns, depth = pixels_of(one.view, points)
        is_there = np.abs(one.before.depth[rows, columns] - depth) <= DEPTH_TOLERANCE * depth
        is_other = (one.before.alpha >= COVERED) & ~dilate(one.is_open, RIM_PX)
        is_there &= is_other[rows, columns]
        found[is_there] = one.before.image[rows, columns][is_there]
    is_seen = np.isfinite(colors[..., 0]).any(0)
    out = np.full((len(points), 3), np.nan, np.float32)
    if is_seen.any():
        out[is_seen] = np.nanmedian(colors[:, is_seen], axis=0)
    return out


def _discs(
    means: np.ndarray, normals: np.ndarray, colors: np.ndarray, is_guess: np.ndarray, cell: float
) -> FillGaussians:
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    third = np.where(lengths > 0, normals / np.where(lengths > 0, lengths, 1.0), (0.0, 0.0, 1.0))
    helper = np.where(np.abs(third[:, :1]) < 0.9, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    first = np.cross(helper, third)
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-12)
    rotations = np.stack([first, np.cross(third, first), third], axis=2)
    n = len(means)
    return FillGaussians(
        means=means.astype(np.float32),
        quats=quats_of(rotations).astype(np.float32) if n else np.zeros((0, 4), np.float32),
        scales=np.tile(np.array([WIDTH, WIDTH, THICKNESS], np.float32) * np.float32(cell), (n, 1)),
        opacities=np.full(n, OPACITY, np.float32),
        colors=np.clip(colors, 0.0, 1.0).astype(np.float32),
        is_guess=is_guess,
    )
