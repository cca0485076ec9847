"""Which points lie inside the visual hull of what moves: places where all sides see something else than the background.

A point of the static scene is there when something covers it all around, or when what it belongs to has gone: a box
that rested while the background was made, and was carried away. The hull cannot tell the two apart and need not: in
either case the point is not to be seen as it was. Letters: M frames, C cameras, A points.
"""

from __future__ import annotations

import numpy as np

from engine.camera.projection import is_in_picture, project, projection_matrices
from engine.camera.rig import CameraRig
from engine.cloud.motion.moving_cloud import hull_votes


def frames_inside(points: np.ndarray, masks: np.ndarray, rig: CameraRig) -> np.ndarray:
    """In how many frames each point lies inside the hull, by the votes of engine.cloud.motion.moving_cloud.

    Unlike the carving of voxels, which forgives a pixel, this asks for the pixel itself: a floor beside a foot is not
    inside it.

    Args:
        points: Scene units. [A, 3]
        masks: Motion masks. [M, C, H, W] bool
        rig: The cameras of the masks, at their size.
    Returns:
        [A] int64, 0..M.
    """
    n_frames, n_cameras, height, width = masks.shape
    min_hits, n_misses = hull_votes(n_cameras)
    n_hits, n_missed = np.zeros((2, n_frames, len(points)), dtype=np.int64)
    for camera, projection in enumerate(projection_matrices(rig)):
        pixels, depths = project(np.asarray(points, dtype=np.float64), projection)
        seen = np.flatnonzero(is_in_picture(pixels, depths, width, height))
        columns, rows = pixels[seen].astype(np.int64).T
        is_moving = masks[:, camera, rows, columns]  # [M, seen]
        n_hits[:, seen] += is_moving
        n_missed[:, seen] += ~is_moving
    return ((n_hits >= min_hits) & (n_missed <= n_misses)).sum(axis=0)
