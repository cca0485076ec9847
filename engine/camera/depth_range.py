"""How near and how far each camera has to look, derived from the rig and, where there are some, sparse points.

No shape of the scene is assumed. Cameras may sit on the scene's own surface (a dome, the walls of a room), so the
near plane is not a small constant but a share of the focus distance: otherwise wall Gaussians next to an unseen camera
cover its whole picture.
"""

from __future__ import annotations

import numpy as np

from engine.camera.projection import is_in_picture, project, projection_matrices
from engine.camera.rig import CameraRig

NEAR_SHARE = 0.2
"""Near plane as a share of the distance to the focus point."""
FOCUS_RANGE = (0.7, 3.0)
"""Depth range in focus distances where nothing else is known."""
MIN_POINTS = 30
"""Fewer sparse points in a picture than this do not say how deep it is."""
POINT_MARGINS = (0.8, 1.3)
"""The 1 % and 99 % depths of sparse points are widened by these factors: points sit on texture only."""


def focus_distances(rig: CameraRig) -> np.ndarray:
    """Distance of every camera centre to the rig's focus point, scene units. [C]"""
    return np.linalg.norm(rig.centers - rig.focus_point(), axis=1)


def near_plane(rig: CameraRig) -> float:
    """Depth below which nothing is drawn in any camera: a fifth of the median focus distance, scene units."""
    return NEAR_SHARE * float(np.median(focus_distances(rig)))


def depth_ranges(rig: CameraRig, points: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Nearest and farthest depth to search per camera.

    Args:
        points: Sparse world points [P, 3], or None.
    Returns:
        near [C], far [C], camera z in scene units, near_plane(rig) <= near < far.

    A camera with at least MIN_POINTS points in its picture takes their 1 % and 99 % depths with a margin; any other
    takes FOCUS_RANGE times its own focus distance.
    """
    distances = np.maximum(focus_distances(rig), 1e-6)
    near, far = FOCUS_RANGE[0] * distances, FOCUS_RANGE[1] * distances
    if points is not None and len(points):
        for camera, projection in enumerate(projection_matrices(rig)):
            pixels, depths = project(np.asarray(points, dtype=np.float64), projection)
            seen = depths[is_in_picture(pixels, depths, *rig.image_sizes[camera])]
            if len(seen) >= MIN_POINTS:
                low, high = np.percentile(seen, [1.0, 99.0])
                near[camera], far[camera] = POINT_MARGINS[0] * low, POINT_MARGINS[1] * high
    near = np.maximum(near, near_plane(rig))
    return near, np.maximum(far, 1.5 * near)
