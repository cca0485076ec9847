"""A camera path as wire: the way of the camera, and a pyramid at each key. Which key lies under the pointer. No GL."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from engine.camera.camera_path import CameraKey, CameraPath
from engine.camera.projection import pinhole_K, to_camera, to_pixels
from engine.camera.rig import CameraRig
from ui.gl.lines import frusta_lines
from ui.style.colors import PATH, Color

SAMPLES, MOST_PER_PIECE, LEAST_PER_PIECE = 256, 24, 6
"""Straight pieces of a whole path, and at least and at most between two keys: very short ones would look like beads."""
PICTURE_SIZE = (160, 90)
"""Shape of the pictures at the keys."""
MOST_PYRAMIDS = 400
"""Keys beyond this number have no pyramid: nobody could distinguish them."""


def path_line(path: CameraPath) -> np.ndarray:
    """The way of the camera as line segments, two vertices each. [2 L, 3] float32"""
    if len(path.keys) < 2:
        return np.zeros((0, 3), np.float32)
    frames = [key.frame for key in path.keys]
    if path.is_closed:
        frames.append(path.frame_range[1])
    per_piece = min(max(SAMPLES // (len(frames) - 1), LEAST_PER_PIECE), MOST_PER_PIECE)
    steps = np.arange(per_piece) / per_piece
    times = np.concatenate([start + (stop - start) * steps for start, stop in pairwise(frames)])
    # the way is sampled up to the very last frame, where a loop is back at its first key
    points = path.centers(np.append(times, frames[-1]))
    return np.stack([points[:-1], points[1:]], axis=1).reshape(-1, 3).astype(np.float32)


def key_rig(keys: tuple[CameraKey, ...]) -> CameraRig:
    """Keys as cameras, to be drawn as such."""
    return CameraRig(
        names=("",) * len(keys),
        world_to_camera=np.stack([key.world_to_camera for key in keys]) if keys else np.zeros((0, 4, 4)),
        Ks=np.array([pinhole_K(key.fov_y_rad, PICTURE_SIZE) for key in keys]).reshape(-1, 3, 3),
        image_sizes=np.tile(np.array(PICTURE_SIZE), (len(keys), 1)),
    )


def key_pyramids(
    keys: tuple[CameraKey, ...], size: float, *, chosen: int | None = None, color: Color = PATH
) -> tuple[np.ndarray, np.ndarray]:
    """Vertices [2 L, 3] and colours [2 L, 4] of a pyramid at each key, see ui.gl.lines.frusta_lines."""
    return frusta_lines(
        key_rig(keys[:MOST_PYRAMIDS]), size, chosen=chosen if _has_pyramid(chosen) else None, color=color
    )


def _has_pyramid(number: int | None) -> bool:
    return number is not None and number < MOST_PYRAMIDS


def key_under(
    keys: tuple[CameraKey, ...],
    world_to_camera: np.ndarray,
    K: np.ndarray,
    x: float,
    y: float,
    *,
    near: float,
    reach_px: float,
) -> int | None:
    """Number of the key whose point is nearest to a pixel. Its pyramid does not count: a drag there turns the view.

    Args:
        world_to_camera: Of the view. [4, 4]
        K: Of the picture in which x and y are pixels. [3, 3]
        near: Nothing nearer than this is drawn, scene units.
        reach_px: How near to the point the pointer has to be.
    """
    if not keys:
        return None
    points = to_camera(np.stack([key.center for key in keys]), world_to_camera)
    away = np.linalg.norm(to_pixels(points, K) - np.array([x, y]), axis=1)
    away = np.where(points[:, 2] > near, away, np.inf)
    nearest = int(np.argmin(away))
    return nearest if away[nearest] <= reach_px else None
