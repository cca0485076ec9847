"""Points where no training camera looks, so that a view from between the cameras shows something smooth, never a hole.

Seen from the cameras with a wider picture, and from half way between neighbouring ones, the cloud ends somewhere: at
the edge of all pictures, behind what stands in front. There its surface is continued by a thin plate, which continues
flat, in the colours around. What a camera looks through is left out, so nothing gets in the way of what is seen.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import minimum_filter
from scipy.spatial import KDTree

from engine.camera.projection import is_in_picture, pixel_rays, project, projection_matrices, to_world
from engine.camera.rig import CameraRig
from engine.cloud.stereo.depth.consistency import SEE_THROUGH_SHARE
from engine.cloud.stereo.depth.fill import fill_inverse_depth
from engine.cloud.voxel import voxel_means

MARGIN = 0.3
"""The wider pictures continue by this share of the width and of the height on every side."""
VIEW_WIDTH_PX = 96
N_NEIGHBORS = 2
"""Each camera is joined with so many of the nearest ones by a view from half way."""
UNSEEN_SPACINGS = 1.5
"""Distance between new points, in spacings of the cloud: there is no detail where no camera looks."""
OVERLAP = 2.0
"""Size of the Gaussians of new points in distances between them. They never learn to close gaps."""
N_BACKDROP = 1200
"""Points of the backdrop in all directions."""
BEHIND = 1.08
"""Distance of the backdrop from the middle of the scene, in distances of the farthest points in that direction."""
APART_SPACINGS = 1.0
"""New points are at least this far from the cloud."""
N_COLORS = 24
"""Neighbours whose mean colour a new point takes."""


def unseen_points(
    points: np.ndarray, colors: np.ndarray, rig: CameraRig, depths: np.ndarray, spacing: float, *, max_points: int
) -> tuple[np.ndarray, np.ndarray, float]:
    """Points and colours to add to a cloud.

    Args:
        points, colors: The cloud. [P, 3] each
        rig: At the size of the depth maps.
        depths: Complete depth maps of all cameras. [C, h, w]
        spacing: Of the cloud, scene units.
        max_points: The new points are coarser than the cloud, and as much coarser as it takes to be no more than this.
    Returns:
        points [Q, 3], colors [Q, 3], float64, and the size of their Gaussians, scene units. None of the points is where
        a camera looks through, or near the cloud.
    """
    tree = KDTree(points)
    found = np.concatenate([_continued(points, view, spacing) for view in _views(rig)])
    found = found[~_is_looked_through(found, rig, depths)]
    found = found[tree.query(found)[0] > APART_SPACINGS * spacing]
    coarse = UNSEEN_SPACINGS * spacing
    if len(found) == 0 or max_points < 1:
        return np.zeros((0, 3)), np.zeros((0, 3)), OVERLAP * coarse
    samples = found
    while len(found := voxel_means(samples, coarse, [], np.ones(len(samples)))[0]) > max_points:
        coarse *= 1.1
    nearest = np.asarray(tree.query(found, min(N_COLORS, len(points)))[1]).reshape(len(found), -1)
    return found, colors[nearest].mean(1), OVERLAP * coarse


def backdrop(
    points: np.ndarray, colors: np.ndarray, rig: CameraRig, depths: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A coarse shell behind everything, in the colours of what is before it: where surfaces have gaps, these show it.

    Args:
        points, colors, rig, depths: As in `unseen_points`.
    Returns:
        points [B, 3], colors [B, 3], sizes of their Gaussians [B], float64. Only where a wide view looks and no camera
        looks through.
    """
    turn = np.arange(N_BACKDROP) * np.pi * (3 - np.sqrt(5))
    height = 1 - 2 * (np.arange(N_BACKDROP) + 0.5) / N_BACKDROP
    flat = np.sqrt(1 - height**2)
    directions = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), height])
    center = rig.focus_point()
    offsets = points - center
    distances = np.maximum(np.linalg.norm(offsets, axis=1), 1e-9)
    n_neighbors = min(N_COLORS, len(points))
    nearest = np.asarray(KDTree(offsets / distances[:, None]).query(directions, n_neighbors)[1])
    nearest = nearest.reshape(N_BACKDROP, n_neighbors)
    reach = BEHIND * np.quantile(distances[nearest], 0.9, axis=1)
    places = center + directions * reach[:, None]
    tints = colors[np.asarray(KDTree(points).query(places, n_neighbors)[1]).reshape(N_BACKDROP, n_neighbors)].mean(1)
    is_seen = np.zeros(N_BACKDROP, dtype=bool)
    for view in _views(rig):
        is_seen |= is_in_picture(*project(places, projection_matrices(view)[0]), *view.image_sizes[0])
    is_kept = is_seen & ~_is_looked_through(places, rig, depths)
    sizes = OVERLAP * reach * np.sqrt(4 * np.pi / N_BACKDROP)
    return places[is_kept], tints[is_kept], sizes[is_kept]


def _views(rig: CameraRig) -> list[CameraRig]:
    """The cameras, and half way between neighbours, with wide and small pictures; one view each."""
    poses = list(rig.world_to_camera)
    centers = rig.centers
    distances = np.linalg.norm(centers[:, None] - centers[None], axis=-1)
    nearest = np.argsort(distances, axis=1, kind="stable")[:, 1 : 1 + N_NEIGHBORS]
    pairs = sorted({(min(a, int(b)), max(a, int(b))) for a, row in enumerate(nearest) for b in row})
    of_views = list(range(len(rig)))
    for a, b in pairs:
        pose = _half_way(rig.world_to_camera[a], rig.world_to_camera[b])
        if pose is not None:
            poses.append(pose)
            of_views.append(a)
    views = []
    for pose, camera in zip(poses, of_views, strict=True):
        width, height = rig.image_sizes[camera]
        scale = VIEW_WIDTH_PX / ((1 + 2 * MARGIN) * width)
        K = rig.Ks[camera].copy()
        K[:2, 2] += MARGIN * np.array([width, height])
        K[:2] *= scale
        size = np.array([[VIEW_WIDTH_PX, round((1 + 2 * MARGIN) * height * scale)]])
        views.append(CameraRig(("view",), pose[None], K[None], size))
    return views


def _half_way(first: np.ndarray, second: np.ndarray) -> np.ndarray | None:
    """The pose between two [4, 4]; None where they look in opposite directions."""
    forward, down = first[2, :3] + second[2, :3], first[1, :3] + second[1, :3]
    right = np.cross(down, forward)
    if np.linalg.norm(forward) < 0.1 or np.linalg.norm(right) < 0.1:
        return None
    forward /= np.linalg.norm(forward)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward])
    center = -0.5 * (first[:3, :3].T @ first[:3, 3] + second[:3, :3].T @ second[:3, 3])
    pose[:3, 3] = -pose[:3, :3] @ center
    return pose


def _continued(points: np.ndarray, view: CameraRig, spacing: float) -> np.ndarray:
    """The plate through what the view shows of the cloud, where it shows none of it. [N, 3]"""
    width, height = (int(side) for side in view.image_sizes[0])
    pixels, depths = project(points, projection_matrices(view)[0])
    rows = np.flatnonzero(is_in_picture(pixels, depths, width, height))
    if len(rows) == 0:
        return np.zeros((0, 3))
    nearest = np.full((height, width), np.inf)
    x, y = pixels[rows].astype(int).T
    np.minimum.at(nearest, (y, x), depths[rows])
    # a point stands for a disc of a spacing: as large as where half of the points are
    reach = max(1, round(spacing * view.Ks[0, 0, 0] / float(np.median(depths[rows]))))
    nearest = minimum_filter(nearest, size=2 * reach + 1, mode="constant", cval=np.inf)
    is_shown = np.isfinite(nearest)
    low, high = 1 / np.percentile(depths[rows], 99.0), 1 / np.percentile(depths[rows], 1.0)
    filled = fill_inverse_depth(
        np.where(is_shown, 1 / nearest, 0.0), is_shown.astype(float), np.zeros_like(nearest), low=0.8 * low, high=high
    )
    rays = pixel_rays(view.Ks[0], width, height)
    return to_world((rays / filled[..., None])[~is_shown], view.world_to_camera[0])


def _is_looked_through(points: np.ndarray, rig: CameraRig, depths: np.ndarray) -> np.ndarray:
    """Whether a camera sees something behind the point. [N] bool"""
    is_through = np.zeros(len(points), dtype=bool)
    for camera, projection in enumerate(projection_matrices(rig)):
        pixels, own = project(points, projection)
        rows = np.flatnonzero(is_in_picture(pixels, own, *rig.image_sizes[camera]))
        x, y = pixels[rows].astype(int).T
        is_through[rows] |= depths[camera, y, x] > (1 + SEE_THROUGH_SHARE) * own[rows]
    return is_through
