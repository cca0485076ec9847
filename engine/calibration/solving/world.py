"""The world of a calibration: which way is up, where the floor is, and how large things are."""

from __future__ import annotations

import numpy as np

from engine.calibration.solving.cameras import Cameras

N_TRIES = 400
FLOOR_TOLERANCE = 0.015
"""Distance from the floor within which points lie on it, as a share of the distance from cameras to what they see."""
MIN_FLOOR_SHARE = 0.08
"""Of all points; smaller planes are tables and walls."""
MAX_TILT_DEG = 35.0
"""Of the floor against the cameras' mean upper edge."""
UNIT_DISTANCE = 3.0
"""From the cameras to the middle of what they see, where no distance is known."""


def find_up(cameras: Cameras, points: np.ndarray, way: str) -> tuple[np.ndarray, np.ndarray, str]:
    """Unit up direction [3], a point at height 0 [3], and what they were found from: "floor" or "cameras".

    Args:
        cameras: Any scale and axes.
        points: The points they see. [P, 3]
        way: "floor" or "cameras"; a floor that cannot be found is replaced by the cameras.
    """
    upper = -cameras.rotations[:, 1]  # the direction of each picture's upper edge
    up = upper.mean(0) / max(float(np.linalg.norm(upper.mean(0))), 1e-9)
    middle = np.median(points, axis=0)
    floor = _floor(cameras, points, up) if way == "floor" else None
    if floor is None:
        return up, middle, "cameras"
    normal, on_floor = floor
    return normal, middle - ((middle - on_floor) @ normal) * normal, "floor"


def upright(
    cameras: Cameras, points: np.ndarray, up: np.ndarray, origin: np.ndarray, scale: float
) -> tuple[Cameras, np.ndarray]:
    """Cameras and points in a world with z up, `origin` at 0, `scale` times as large."""
    ahead = cameras.rotations[0, 2] - (cameras.rotations[0, 2] @ up) * up
    if np.linalg.norm(ahead) < 1e-6:
        ahead = np.cross(up, [1.0, 0.0, 0.0]) + np.cross(up, [0.0, 1.0, 0.0]) * 1e-3
    y = ahead / np.linalg.norm(ahead)
    rotation = np.stack([np.cross(y, up), y, up])
    shift = -scale * rotation @ origin
    return cameras.moved(scale, rotation, shift), scale * points @ rotation.T + shift


def unit_scale(cameras: Cameras, points: np.ndarray) -> float:
    """Scale by which cameras stand UNIT_DISTANCE from the middle of what they see."""
    distances = np.linalg.norm(cameras.centers - np.median(points, axis=0), axis=-1)
    return UNIT_DISTANCE / max(float(np.median(distances)), 1e-9)


def known_scale(cameras: Cameras, first: int, second: int, metres: float) -> float:
    """Scale by which two cameras stand `metres` apart."""
    centers = cameras.centers
    return metres / max(float(np.linalg.norm(centers[first] - centers[second])), 1e-12)


def _floor(cameras: Cameras, points: np.ndarray, up: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Normal and a point of the plane that most points lie on, roughly level and with the cameras above it."""
    if len(points) < 30:
        return None
    reach = float(np.median(np.linalg.norm(cameras.centers - np.median(points, axis=0), axis=-1)))
    tolerance = FLOOR_TOLERANCE * reach
    generator = np.random.default_rng(0)
    triples = points[np.array([generator.choice(len(points), 3, replace=False) for _ in range(N_TRIES)])]
    normals = np.cross(triples[:, 1] - triples[:, 0], triples[:, 2] - triples[:, 0])
    lengths = np.linalg.norm(normals, axis=-1)
    normals = normals / np.maximum(lengths, 1e-12)[:, None]
    normals *= np.where(normals @ up < 0, -1.0, 1.0)[:, None]
    is_level = (normals @ up > np.cos(np.radians(MAX_TILT_DEG))) & (lengths > 1e-12)
    best, n_best = None, MIN_FLOOR_SHARE * len(points)
    for normal, start in zip(normals[is_level], triples[is_level, 0], strict=True):
        if (((cameras.centers - start) @ normal) <= 0).any():
            continue
        n_on = int((np.abs((points - start) @ normal) < tolerance).sum())
        if n_on > n_best:
            best, n_best = (normal, start), n_on
    if best is None:
        return None
    on = points[np.abs((points - best[1]) @ best[0]) < tolerance]
    normal = np.linalg.svd(on - on.mean(0), full_matrices=False)[2][2]
    return (normal if normal @ up > 0 else -normal), on.mean(0)
