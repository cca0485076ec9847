"""Colours of points in the cameras that see them, and how the cameras differ in white balance.

Letters: C cameras, H W full pictures, P points.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from engine.camera.projection import is_in_picture, project, projection_matrices
from engine.camera.rig import CameraRig
from engine.cloud.background.gains import gain_spread, gains_from_observations, scene_colors
from engine.cloud.stereo.depth.depth_scene import DepthMaps
from engine.images.image_filters import block_mean

COLOR_DEPTH_TOLERANCE = 0.05


def observe(
    points: np.ndarray, pictures: np.ndarray, is_stable: np.ndarray, rig: CameraRig, maps: DepthMaps
) -> np.ndarray:
    """log(colour + 1) of the points in the cameras that see them unoccluded, NaN elsewhere. [C, P, 3] float32"""
    factor = max(1, pictures.shape[2] // int(maps.rig.image_sizes[0, 0]))
    log_colors = np.full((len(rig), len(points), 3), np.nan, dtype=np.float32)
    for camera, projection in enumerate(projection_matrices(rig)):
        half = max(1, factor // 2)
        picture, stable = block_mean(pictures[camera], half), block_mean(is_stable[camera], half) > 0.99
        pixels, depths = project(points, projection)
        rows = np.flatnonzero(is_in_picture(pixels, depths, picture.shape[1] * half, picture.shape[0] * half))
        x, y = (pixels[rows] / half).astype(int).T
        map_x = np.minimum((pixels[rows, 0] / factor).astype(int), maps.depths.shape[2] - 1)
        map_y = np.minimum((pixels[rows, 1] / factor).astype(int), maps.depths.shape[1] - 1)
        is_front = np.abs(depths[rows] / maps.depths[camera, map_y, map_x] - 1.0) < COLOR_DEPTH_TOLERANCE
        is_good = is_front & stable[y, x]
        log_colors[camera, rows[is_good]] = np.log(picture[y[is_good], x[is_good]] + 1.0)
    return log_colors


def balance(
    points: np.ndarray, log_colors: np.ndarray, first_gains: np.ndarray, color: str
) -> tuple[np.ndarray, np.ndarray, str]:
    """Gains [C, 3], median scene colours [P, 3] 0..255 and a line that says what was decided and why."""
    measured = gain_spread(points, log_colors)
    numbers = (
        f"gains of the cameras spread by {100 * measured.spread:.2f} %, "
        f"uncertain by {100 * measured.uncertainty:.2f} % "
        f"({measured.n_cameras} of {len(first_gains)} cameras measured)"
    )
    if color == "gain" or (color == "auto" and measured.is_real):
        gains, colors = gains_from_observations(log_colors, first_gains)
        why = "cameras differ" if color == "auto" else "color=gain"
        return gains, colors, f"{why}, {numbers}; gains {gains.min():.2f} to {gains.max():.2f}"
    gains = np.ones_like(first_gains)
    why = "cameras do not differ" if color == "auto" else "color=off"
    return gains, scene_colors(log_colors, gains), f"{why}, {numbers}; no gains"


def colored_by_neighbors(points: np.ndarray, colors: np.ndarray, seen_colors: np.ndarray) -> np.ndarray:
    """Colours of all points, where some were not seen by any camera: those take the median of their surroundings.

    What only unstable pixels saw may be a person's colour on the floor.

    Args:
        points: [P, 3]
        colors: Where no point at all was seen. [P, 3]
        seen_colors: NaN where not seen. [P, 3]
    """
    is_colored = np.asarray(np.isfinite(seen_colors).all(axis=1))
    colors = np.where(is_colored[:, None], seen_colors, colors)
    if is_colored.any() and not is_colored.all():
        n_neighbors = min(4, int(is_colored.sum()))
        neighbors = np.asarray(KDTree(points[is_colored]).query(points[~is_colored], n_neighbors)[1])
        colors[~is_colored] = np.median(colors[is_colored][neighbors.reshape(len(neighbors), -1)], axis=1)
    return colors
