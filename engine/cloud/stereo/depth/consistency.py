"""Do other cameras agree with a depth map? Counts agreement and contradiction per pixel; decides nothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from engine.camera.rig import CameraRig

SEE_THROUGH_SHARE = 0.06
"""A camera contradicts a point when its own depth lies this share beyond it: it looks through the point."""
EDGE_SHARE = 0.1
"""Neighbouring depths that differ by more belong to different surfaces."""


@dataclass(frozen=True, slots=True)
class DepthAgreement:
    """The other cameras' check of each pixel of one depth map.

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
) -> DepthAgreement:
    """Compare one depth map with those of other cameras.

    Args:
        depth_maps: Camera z of every camera, positive. [C, H, W] float64
        rig: At the size of the maps.
        others: Cameras to ask.
        tolerance: Relative depth difference that still agrees.
    """
    size = depth_maps.shape[1:]
    result = DepthAgreement(np.zeros(size, np.int32), np.zeros(size, np.int32), np.zeros(size))
    _check(
        depth_maps,
        np.linalg.inv(rig.Ks),
        rig.Ks,
        rig.world_to_camera,
        camera,
        np.asarray(others, dtype=np.int64),
        tolerance,
        result.n_agree,
        result.n_see_through,
        result.depths,
    )
    return result


@njit(cache=True, nogil=True, error_model="numpy")
def _depth_at(depth_maps, camera, x, y):
    """Bilinear on one surface, nearest across a depth edge. On a floor at a grazing angle one pixel is 2 % of depth."""
    _, height, width = depth_maps.shape
    x0, y0 = min(max(int(x - 0.5), 0), width - 2), min(max(int(y - 0.5), 0), height - 2)
    fx, fy = min(max(x - 0.5 - x0, 0.0), 1.0), min(max(y - 0.5 - y0, 0.0), 1.0)
    a, b = depth_maps[camera, y0, x0], depth_maps[camera, y0, x0 + 1]
    c, d = depth_maps[camera, y0 + 1, x0], depth_maps[camera, y0 + 1, x0 + 1]
    if max(max(a, b), max(c, d)) > (1.0 + EDGE_SHARE) * min(min(a, b), min(c, d)):
        return depth_maps[camera, int(y), int(x)]
    return (a * (1 - fx) + b * fx) * (1 - fy) + (c * (1 - fx) + d * fx) * fy


@njit(cache=True, nogil=True, error_model="numpy")
def _check(depth_maps, inverse_Ks, Ks, poses, camera, others, tolerance, n_agree, n_through, fused):
    """Adds to the counts and writes the mean depths."""
    _, height, width = depth_maps.shape
    for y in range(height):
        for x in range(width):
            depth = depth_maps[camera, y, x]
            u, v = x + 0.5, y + 0.5
            px = (inverse_Ks[camera, 0, 0] * u + inverse_Ks[camera, 0, 1] * v + inverse_Ks[camera, 0, 2]) * depth
            py = (inverse_Ks[camera, 1, 0] * u + inverse_Ks[camera, 1, 1] * v + inverse_Ks[camera, 1, 2]) * depth
            pz = (inverse_Ks[camera, 2, 0] * u + inverse_Ks[camera, 2, 1] * v + inverse_Ks[camera, 2, 2]) * depth
            px, py, pz = px - poses[camera, 0, 3], py - poses[camera, 1, 3], pz - poses[camera, 2, 3]
            wx = poses[camera, 0, 0] * px + poses[camera, 1, 0] * py + poses[camera, 2, 0] * pz
            wy = poses[camera, 0, 1] * px + poses[camera, 1, 1] * py + poses[camera, 2, 1] * pz
            wz = poses[camera, 0, 2] * px + poses[camera, 1, 2] * py + poses[camera, 2, 2] * pz
            total = depth
            n_matches = 0
            for k in range(len(others)):
                other = others[k]
                cx = poses[other, 0, 0] * wx + poses[other, 0, 1] * wy + poses[other, 0, 2] * wz + poses[other, 0, 3]
                cy = poses[other, 1, 0] * wx + poses[other, 1, 1] * wy + poses[other, 1, 2] * wz + poses[other, 1, 3]
                cz = poses[other, 2, 0] * wx + poses[other, 2, 1] * wy + poses[other, 2, 2] * wz + poses[other, 2, 3]
                if cz <= 1e-9:
                    continue
                a = (Ks[other, 0, 0] * cx + Ks[other, 0, 1] * cy) / cz + Ks[other, 0, 2]
                b = Ks[other, 1, 1] * cy / cz + Ks[other, 1, 2]
                if a < 0 or b < 0 or a >= width or b >= height:
                    continue
                theirs = _depth_at(depth_maps, other, a, b)
                relative = (theirs - cz) / cz
                if relative > SEE_THROUGH_SHARE:
                    n_through[y, x] += 1
                if abs(relative) < tolerance:
                    n_matches += 1
                    # their surface point, along their own pixel ray, seen from here
                    tx = inverse_Ks[other, 0, 0] * a + inverse_Ks[other, 0, 1] * b + inverse_Ks[other, 0, 2]
                    tx = tx * theirs - poses[other, 0, 3]
                    ty = (inverse_Ks[other, 1, 1] * b + inverse_Ks[other, 1, 2]) * theirs - poses[other, 1, 3]
                    tz = theirs - poses[other, 2, 3]
                    total += poses[camera, 2, 3]
                    for i in range(3):
                        along = poses[other, 0, i] * tx + poses[other, 1, i] * ty + poses[other, 2, i] * tz
                        total += poses[camera, 2, i] * along
            n_agree[y, x] += n_matches
            fused[y, x] = total / (1 + n_matches)
