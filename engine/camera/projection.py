"""Pinhole projections of numpy points for cloud building. Not differentiable; pixel centres lie at +0.5."""

from __future__ import annotations

import numpy as np

from engine.camera.rig import CameraRig


def projection_matrices(rig: CameraRig) -> np.ndarray:
    """K [R | t] per camera: homogeneous world points to (x px * depth, y px * depth, depth). [C, 3, 4]"""
    return rig.Ks @ rig.world_to_camera[:, :3]


def project(points: np.ndarray, projection: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pixels [P, 2] and depths [P] of world points [P, 3]; pixels mean nothing where depth <= 0 (they stay finite)."""
    homogeneous = points @ projection[:, :3].T + projection[:, 3]
    depths = homogeneous[:, 2]
    safe = np.where(np.abs(depths) > 1e-9, depths, 1e-9)
    return homogeneous[:, :2] / safe[:, None], depths


def pixel_rays(K: np.ndarray, width: int, height: int) -> np.ndarray:
    """Camera-space rays with z = 1 through every pixel centre. [H, W, 3]"""
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return np.stack([x, y, np.ones_like(x)], axis=-1) @ np.linalg.inv(K).T


def unproject(depths: np.ndarray, K: np.ndarray, world_to_camera: np.ndarray) -> np.ndarray:
    """World points of a depth picture [H, W] (camera z). [H, W, 3]"""
    points_camera = pixel_rays(K, depths.shape[1], depths.shape[0]) * depths[..., None]
    return (points_camera - world_to_camera[:3, 3]) @ world_to_camera[:3, :3]


def is_in_picture(pixels: np.ndarray, depths: np.ndarray, width: int, height: int) -> np.ndarray:
    """True for points in front of the camera that fall on the picture. [P] bool"""
    x, y = pixels[:, 0], pixels[:, 1]
    return (depths > 0) & (x >= 0) & (y >= 0) & (x < width) & (y < height)
