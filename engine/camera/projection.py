"""The pinhole camera for numpy points: world to camera to pixels and back. Not differentiable.

OpenCV axes (x right, y down, z forward); pixel centres lie at +0.5; depths are camera z.
"""

from __future__ import annotations

import math

import numpy as np

from engine.camera.rig import CameraRig


def to_camera(points: np.ndarray, world_to_camera: np.ndarray) -> np.ndarray:
    """World points [..., 3] in a camera's axes. [..., 3]"""
    return points @ world_to_camera[:3, :3].T + world_to_camera[:3, 3]


def to_world(points_camera: np.ndarray, world_to_camera: np.ndarray) -> np.ndarray:
    """Points [..., 3] in a camera's axes as world points. [..., 3]"""
    return (points_camera - world_to_camera[:3, 3]) @ world_to_camera[:3, :3]


def camera_center(world_to_camera: np.ndarray) -> np.ndarray:
    """Where a camera stands in the world. [3]"""
    return -world_to_camera[:3, :3].T @ world_to_camera[:3, 3]


def to_pixels(points_camera: np.ndarray, K: np.ndarray) -> np.ndarray:
    """Pixels [P, 2] of points [P, 3] in a camera's axes; they mean nothing at depths <= 0 (they stay finite)."""
    depths = np.maximum(points_camera[:, 2], 1e-9)
    x, y = points_camera[:, 0], points_camera[:, 1]
    return np.stack([K[0, 0] * x / depths + K[0, 2], K[1, 1] * y / depths + K[1, 2]], axis=-1)


def focal_px(Ks: np.ndarray) -> np.ndarray:
    """One focal length per camera: the geometric mean of fx and fy, px. [...]"""
    return np.sqrt(Ks[..., 0, 0] * Ks[..., 1, 1])


def vertical_fov(focal_px: float, height_px: float) -> float:
    """Vertical field of view of a picture, radians."""
    return 2.0 * math.atan(height_px / (2.0 * focal_px))


def pinhole_K(fov_y_rad: float, image_size: tuple[int, int]) -> np.ndarray:
    """Intrinsics of a lens with its axis in the middle of the picture. [3, 3]

    Args:
        fov_y_rad: Vertical field of view.
        image_size: Width and height, pixels.
    """
    width, height = image_size
    focal = height / (2.0 * math.tan(fov_y_rad / 2.0))
    return np.array([[focal, 0.0, width / 2.0], [0.0, focal, height / 2.0], [0.0, 0.0, 1.0]])


def relative_homography(rig: CameraRig, camera: int, other: int) -> tuple[np.ndarray, np.ndarray]:
    """(matrix [3, 3], shift [3]) so that pixel p of `camera` at inverse depth q lies at matrix @ p + q shift."""
    rotation = rig.world_to_camera[other, :3, :3] @ rig.world_to_camera[camera, :3, :3].T
    translation = rig.world_to_camera[other, :3, 3] - rotation @ rig.world_to_camera[camera, :3, 3]
    return rig.Ks[other] @ rotation @ np.linalg.inv(rig.Ks[camera]), rig.Ks[other] @ translation


def projection_matrices(rig: CameraRig) -> np.ndarray:
    """K [R | t] per camera: homogeneous world points to (x px * depth, y px * depth, depth). [C, 3, 4]"""
    return rig.Ks @ rig.world_to_camera[:, :3]


def project(points: np.ndarray, projection: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pixels [P, 2] and depths [P] of world points [P, 3]; pixels mean nothing where depth <= 0 (they stay finite)."""
    homogeneous = points @ projection[:, :3].T + projection[:, 3]
    depths = homogeneous[:, 2]
    safe = np.where(np.abs(depths) > 1e-9, depths, 1e-9)
    return homogeneous[:, :2] / safe[:, None], depths


def image_jacobians(points: np.ndarray, projection: np.ndarray) -> np.ndarray:
    """How pixels move with world points [P, 3] in front of the camera, px a scene unit. [P, 2, 3]"""
    pixels, depths = project(points, projection)
    return (projection[:2, :3] - pixels[:, :, None] * projection[2, :3]) / np.maximum(depths, 1e-9)[:, None, None]


def pixel_rays(K: np.ndarray, width: int, height: int) -> np.ndarray:
    """Camera-space rays with z = 1 through every pixel centre. [H, W, 3]"""
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return np.stack([x, y, np.ones_like(x)], axis=-1) @ np.linalg.inv(K).T


def unproject(depths: np.ndarray, K: np.ndarray, world_to_camera: np.ndarray) -> np.ndarray:
    """World points of a depth picture [H, W] (camera z). [H, W, 3]"""
    points_camera = pixel_rays(K, depths.shape[1], depths.shape[0]) * depths[..., None]
    return to_world(points_camera, world_to_camera)


def is_in_picture(pixels: np.ndarray, depths: np.ndarray, width: int, height: int) -> np.ndarray:
    """True for points in front of the camera that fall on the picture. [P] bool"""
    x, y = pixels[:, 0], pixels[:, 1]
    return (depths > 0) & (x >= 0) & (y >= 0) & (x < width) & (y < height)
