"""Prisms: which points lie in one, and the prism that a shape cuts out of what a view sees."""

from __future__ import annotations

import math

import numpy as np
from msgspec import structs

from engine.camera.projection import to_camera, to_pixels
from engine.camera.rotations import matrices_of, quats_of
from engine.editing.actions import Vector
from engine.editing.edit import MAX_CORNERS, Prism
from engine.editing.selection.seen_from import SeenFrom

LOW, MARGIN = 0.02, 0.1
"""What counts of things is without this share at either end, plus this share of the rest as room."""


def in_prism(prism: Prism, points: np.ndarray) -> np.ndarray:
    """Points in a prism; one that is not finite is not. points: Scene units. [N, 3]; returns [N] bool"""
    from engine.editing.volumes.outlines import in_outline  # compiled; the window itself does without

    own = own_points(prism, points)
    with np.errstate(invalid="ignore"):
        is_in = np.all(np.abs(own) <= 1.0, axis=1, keepdims=True)[:, 0]
    is_in[is_in] = in_outline(own[is_in, :2], prism.outline)
    return is_in


def own_points(prism: Prism, points: np.ndarray) -> np.ndarray:
    """Points in the axes of a prism, where its outline is the same at all depths: each as the middle of the prism sees
    it from where the sides meet, -1 to 1 in depth. Behind that place nothing is finite. [N, 3] float64"""
    offsets = np.asarray(points, np.float64) - np.asarray(prism.center)
    with np.errstate(invalid="ignore", divide="ignore"):
        own = offsets @ axes_of_prism(prism) / np.asarray(prism.half_sizes)
        if prism.apex is not None:
            widths = widths_at(prism, own[:, 2])
            own[:, :2] /= np.where(widths > 0.0, widths, np.nan)[:, None]
    return own


def widths_at(prism: Prism, depths: np.ndarray) -> np.ndarray:
    """How wide a prism is at some depths of its own, -1 to 1, as factors of its middle."""
    return np.ones_like(depths) if prism.apex is None else 1.0 + depths / prism.apex


def axes_of_prism(prism: Prism) -> np.ndarray:
    """Its axes as columns. [3, 3]"""
    return matrices_of(np.asarray(prism.quat) / np.linalg.norm(prism.quat))


def with_depth(prism: Prism, center: Vector, half_depth: float) -> Prism:
    """A prism that ends elsewhere along its own z axis; its sides stay where they are.

    Args:
        center: Its new middle, on the axis.
    Raises:
        ValueError: It would reach beyond the place where its sides meet.
    """
    if prism.apex is None:
        return structs.replace(prism, center=center, half_sizes=(*prism.half_sizes[:2], half_depth))
    before = prism.apex * prism.half_sizes[2]
    after = before + float(np.subtract(center, prism.center) @ axes_of_prism(prism)[:, 2])
    width, height, _ = prism.half_sizes
    sizes = (width * after / before, height * after / before, half_depth)
    return structs.replace(prism, center=center, half_sizes=sizes, apex=after / half_depth)


def prism_of_lasso(
    pixels: np.ndarray, world_to_camera: np.ndarray, K: np.ndarray, depths: tuple[float, float]
) -> Prism | None:
    """The part of what a view sees inside a closed line, between two distances from the eye.

    Args:
        pixels: Corners of the line, px. [P, 2]
        world_to_camera: Rigid map, OpenCV axes. [4, 4]
        K: Intrinsics in pixels. [3, 3]
        depths: Nearest and farthest, along the ray through the middle of the line, scene units; above 0.
    Returns:
        None where the line has no room in it.
    """
    corners = _fewer(np.asarray(pixels, np.float64), MAX_CORNERS)
    if len(corners) < 3:
        return None
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
    rays = np.linalg.solve(K, np.concatenate([corners, np.ones((len(corners), 1))], axis=1).T).T
    forward = np.linalg.solve(K, np.array([*middle, 1.0]))
    forward /= np.linalg.norm(forward)
    right = np.cross([0.0, 1.0, 0.0], forward)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(forward, right), forward], axis=1)  # columns, in the axes of the camera
    near, far = depths
    distance, half_depth = (near + far) / 2, (far - near) / 2
    own = rays @ axes
    if not (0.0 < near < far and (own[:, 2] > 0.0).all()):
        return None
    outline = distance * own[:, :2] / own[:, 2:]
    width, height = (float(value) for value in np.abs(outline).max(axis=0))
    if np.linalg.svd(outline - outline.mean(axis=0), compute_uv=False)[1] <= 1e-6 * max(width, height):
        return None
    rotation, eye = world_to_camera[:3, :3].T, -world_to_camera[:3, :3].T @ world_to_camera[:3, 3]
    x, y, z = (float(value) for value in eye + distance * rotation @ forward)
    a, b, c, d = (float(value) for value in quats_of(rotation @ axes))
    scaled = np.clip(outline / [width, height], -1.0, 1.0)
    corners_of = tuple((float(u), float(v)) for u, v in scaled)
    return Prism((x, y, z), (width, height, half_depth), corners_of, (a, b, c, d), distance / half_depth)


def depths_under(
    pixels: np.ndarray, means: np.ndarray, opacities: np.ndarray, view: SeenFrom
) -> tuple[float, float] | None:
    """How near and how far the Gaussians under a closed line are, without the few nearest and farthest of them.

    Args:
        pixels: Corners of the line, px. [P, 2]
        means: Scene units. [N, 3]
        opacities: They count by these. [N]
    Returns:
        Along the ray through the middle of the line, with some room, scene units; None where nothing is under it.
    """
    from engine.editing.volumes.outlines import in_outline

    corners = np.asarray(pixels, np.float64)
    seen = to_camera(np.asarray(means, np.float64), view.world_to_camera)
    with np.errstate(invalid="ignore"):
        seen = seen[rows := np.flatnonzero(seen[:, 2] > view.near)]
    is_under = in_outline(to_pixels(seen, view.K), corners)
    if not is_under.any():
        return None
    middle = np.array([*(corners.min(axis=0) + corners.max(axis=0)) / 2, 1.0])
    forward = np.linalg.solve(view.K, middle)
    away = seen[is_under] @ (forward / np.linalg.norm(forward))
    near, far = weighted_quantiles(away, np.asarray(opacities, np.float64)[rows[is_under]], (LOW, 1.0 - LOW))
    room = max(MARGIN * (far - near), 0.01 * far)
    return max(near - room, view.near, 1e-3 * far), far + room


def weighted_quantiles(values: np.ndarray, weights: np.ndarray, shares: tuple[float, ...]) -> list[float]:
    """Values below which these shares of the weight lie. values, weights: At least one, weights not negative. [N]"""
    order = np.argsort(values, kind="stable")
    summed = np.cumsum(weights[order])
    if not summed[-1] > 0.0:
        summed = np.arange(1.0, len(values) + 1.0)
    places = np.searchsorted(summed, np.array(shares) * summed[-1])
    return values[order[np.minimum(places, len(values) - 1)]].tolist()


def _fewer(corners: np.ndarray, most: int) -> np.ndarray:
    """A line with fewer corners, without those that hardly bend it; not more than `most`. [P, 2]"""
    corners = corners[np.isfinite(corners).all(axis=1)]
    if len(corners) < 4:
        return corners
    tolerance = 2e-3 * float(np.ptp(corners, axis=0).max())
    half = len(corners) // 2
    while True:
        closed = np.concatenate([corners, corners[:1]])
        kept = np.concatenate([_bends(closed[: half + 1], tolerance)[:-1], _bends(closed[half:], tolerance)[:-1]])
        if kept.sum() <= most:
            return corners[kept]
        tolerance *= 1.5


def _bends(line: np.ndarray, tolerance: float) -> np.ndarray:
    """Which corners of an open line are needed to stay this near to it; its ends are. [P] bool (Douglas and Peucker)"""
    kept = np.zeros(len(line), bool)
    kept[[0, -1]] = True
    parts = [(0, len(line) - 1)]
    while parts:
        first, last = parts.pop()
        if last - first < 2:
            continue
        inner, chord = line[first + 1 : last] - line[first], line[last] - line[first]
        length = math.hypot(*chord)
        share = np.clip(inner @ chord / max(length * length, 1e-300), 0.0, 1.0)
        away = np.linalg.norm(inner - share[:, None] * chord, axis=1)
        far = int(away.argmax())
        if away[far] > tolerance:
            middle = first + 1 + far
            kept[middle] = True
            parts += [(first, middle), (middle, last)]
    return kept
