"""The point that a ray meets: the one of a scene of Gaussians that one sees along it. numpy only."""

from __future__ import annotations

import numpy as np

from app.playback.modes.arrays import GaussianArrays
from engine.camera.projection import camera_center
from engine.camera.rotations import matrices_of
from engine.conventions import ALPHA_MAX, ALPHA_MIN

SEEN_TRANSMITTANCE = 0.5
"""The point that one sees is where half of the light is stopped."""
REACH = 3.4
"""Standard deviations beyond which even an opaque Gaussian is fainter than ALPHA_MIN."""


def pixel_ray(
    world_to_camera: np.ndarray, K: np.ndarray, x: float, y: float, *, start: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """The ray of a pixel, in the picture that K belongs to.

    Args:
        world_to_camera: Rigid map, OpenCV axes. [4, 4]
        K: Intrinsics in pixels, pixel centres at +0.5. [3, 3]
        x, y: px.
        start: Distance from the camera's centre at which the ray begins, scene units.
    Returns:
        origin, direction: The camera's centre, or a point before it, and a direction of unit length. [3], [3]
    """
    direction = world_to_camera[:3, :3].T @ np.linalg.solve(K, np.array([x, y, 1.0]))
    direction = direction / np.linalg.norm(direction)
    return camera_center(world_to_camera) + start * direction, direction


def point_beside(world_to_camera: np.ndarray, K: np.ndarray, x: float, y: float, place: np.ndarray) -> np.ndarray:
    """The point under a pixel that is as deep in the picture as a place before the camera. Arguments as of
    `pixel_ray`; scene units. [3]"""
    depth = float(world_to_camera[2, :3] @ place + world_to_camera[2, 3])
    in_camera = depth * np.linalg.solve(K, np.array([x, y, 1.0]))
    return world_to_camera[:3, :3].T @ (in_camera - world_to_camera[:3, 3])


def seen_point(gaussians: GaussianArrays, origin: np.ndarray, direction: np.ndarray) -> np.ndarray | None:
    """The point at which half of the light along a ray is stopped; None where less than that is in the way.

    Each Gaussian counts with its largest alpha along the ray, at the place where that is.

    Args:
        origin, direction: Scene units; the direction of unit length. [3], [3]
    """
    offsets = gaussians.means - origin.astype(np.float32)
    along = offsets @ direction.astype(np.float32)
    across_squared = np.einsum("ni,ni->n", offsets, offsets) - along * along
    a, b, c = gaussians.scales.T  # several times faster than max(axis=1)
    reach = REACH * np.maximum(np.maximum(a, b), c)
    rows = np.flatnonzero((along > gaussians.near_plane) & (across_squared < reach * reach))  # NaN is never near
    quats = gaussians.quats[rows].astype(np.float64)
    norms = np.linalg.norm(quats, axis=1)
    is_sound = (norms > 0.0) & np.isfinite(norms)
    rows = rows[is_sound]
    if len(rows) == 0:
        return None
    to_own_axes = matrices_of(quats[is_sound] / norms[is_sound, None]).swapaxes(1, 2)
    scales = np.maximum(gaussians.scales[rows].astype(np.float64), 1e-9)
    means = (to_own_axes @ offsets[rows].astype(np.float64)[:, :, None])[:, :, 0] / scales
    steps = (to_own_axes @ direction) / scales  # in units of standard deviations per scene unit
    depths = (means * steps).sum(axis=1) / np.maximum((steps * steps).sum(axis=1), 1e-30)
    distances_squared = ((depths[:, None] * steps - means) ** 2).sum(axis=1)
    alphas = np.minimum(gaussians.opacities[rows] * np.exp(-0.5 * distances_squared), ALPHA_MAX)
    is_drawn = (alphas >= ALPHA_MIN) & (depths > gaussians.near_plane)
    order = np.argsort(depths[is_drawn], kind="stable")
    left = np.cumprod(1.0 - alphas[is_drawn][order])
    stopping = np.flatnonzero(left <= SEEN_TRANSMITTANCE)
    if len(stopping) == 0:
        return None
    return origin + depths[is_drawn][order][stopping[0]] * direction
