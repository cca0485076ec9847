"""Do other cameras agree with a depth map? Counts agreement and contradiction per pixel; decides nothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from engine.capture.rig import CameraRig

SEE_THROUGH_SHARE = 0.06
"""A camera contradicts a point when its own depth lies this share beyond it: it looks through the point."""
EDGE_SHARE = 0.1
"""Neighbouring depths that differ by more belong to different surfaces."""


@dataclass(frozen=True, slots=True)
class Agreement:
    """What the other cameras say about each pixel of one depth map.

    Attributes:
        n_agree: Cameras whose own depth matches. [H, W] int32
        n_see_through: Cameras that look through the point. [H, W] int32
        depths: Mean of the own depth and those that agree, scene units. [H, W] float64
    """

    n_agree: np.ndarray
    n_see_through: np.ndarray
    depths: np.ndarray


def check_depths(
    depth_maps: np.ndarray, rig: CameraRig, *, camera: int, others: list[int], tolerance: float
) -> Agreement:
    """Compare one depth map with those of other cameras.

    Args:
        depth_maps: Camera z of every camera, positive. [C, H, W] float64
        rig: At the size of the maps.
        others: Cameras to ask.
        tolerance: Relative depth difference that still agrees.
    """
    result = _check(
        depth_maps,
        np.linalg.inv(rig.Ks),
        rig.Ks,
        rig.world_to_camera,
        camera,
        np.asarray(others, dtype=np.int64),
        tolerance,
        SEE_THROUGH_SHARE,
    )
    return Agreement(*result)


@njit(cache=True, nogil=True, error_model="numpy")
def _depth_at(depths, x, y):
    """Bilinear on one surface, nearest across a depth edge. On a floor at a grazing angle one pixel is 2 % of depth."""
    height, width = depths.shape
    nearest = depths[int(y), int(x)]
    x0, y0 = min(max(int(x - 0.5), 0), width - 2), min(max(int(y - 0.5), 0), height - 2)
    fx, fy = min(max(x - 0.5 - x0, 0.0), 1.0), min(max(y - 0.5 - y0, 0.0), 1.0)
    a, b, c, d = depths[y0, x0], depths[y0, x0 + 1], depths[y0 + 1, x0], depths[y0 + 1, x0 + 1]
    if max(max(a, b), max(c, d)) > (1.0 + EDGE_SHARE) * min(min(a, b), min(c, d)):
        return nearest
    return (a * (1 - fx) + b * fx) * (1 - fy) + (c * (1 - fx) + d * fx) * fy


@njit(cache=True, nogil=True, error_model="numpy")
def _check(depth_maps, inverse_Ks, Ks, world_to_camera, camera, others, tolerance, see_through):
    _, height, width = depth_maps.shape
    n_agree = np.zeros((height, width), np.int32)
    n_through = np.zeros((height, width), np.int32)
    fused = np.zeros((height, width), np.float64)
    own_inverse = inverse_Ks[camera]
    own_rotation, own_translation = world_to_camera[camera, :3, :3], world_to_camera[camera, :3, 3]
    forward = own_rotation[2]
    point = np.empty(3)
    for y in range(height):
        for x in range(width):
            depth = depth_maps[camera, y, x]
            u, v = x + 0.5, y + 0.5
            for i in range(3):
                point[i] = (own_inverse[i, 0] * u + own_inverse[i, 1] * v + own_inverse[i, 2]) * depth
                point[i] -= own_translation[i]
            wx = own_rotation[0, 0] * point[0] + own_rotation[1, 0] * point[1] + own_rotation[2, 0] * point[2]
            wy = own_rotation[0, 1] * point[0] + own_rotation[1, 1] * point[1] + own_rotation[2, 1] * point[2]
            wz = own_rotation[0, 2] * point[0] + own_rotation[1, 2] * point[1] + own_rotation[2, 2] * point[2]
            total = depth
            for other in others:
                pose = world_to_camera[other]
                cx = pose[0, 0] * wx + pose[0, 1] * wy + pose[0, 2] * wz + pose[0, 3]
                cy = pose[1, 0] * wx + pose[1, 1] * wy + pose[1, 2] * wz + pose[1, 3]
                cz = pose[2, 0] * wx + pose[2, 1] * wy + pose[2, 2] * wz + pose[2, 3]
                if cz <= 1e-9:
                    continue
                K = Ks[other]
                a = (K[0, 0] * cx + K[0, 1] * cy) / cz + K[0, 2]
                b = K[1, 1] * cy / cz + K[1, 2]
                if a < 0 or b < 0 or a >= width or b >= height:
                    continue
                theirs = _depth_at(depth_maps[other], a, b)
                relative = (theirs - cz) / cz
                if relative > see_through:
                    n_through[y, x] += 1
                if abs(relative) < tolerance:
                    n_agree[y, x] += 1
                    # their surface point, along their own pixel ray, seen from here
                    inverse = inverse_Ks[other]
                    tx = (inverse[0, 0] * a + inverse[0, 1] * b + inverse[0, 2]) * theirs - pose[0, 3]
                    ty = (inverse[1, 1] * b + inverse[1, 2]) * theirs - pose[1, 3]
                    tz = theirs - pose[2, 3]
                    total += own_translation[2]
                    for i in range(3):
                        total += forward[i] * (pose[0, i] * tx + pose[1, i] * ty + pose[2, i] * tz)
            fused[y, x] = total / (1 + n_agree[y, x])
    return n_agree, n_through, fused
