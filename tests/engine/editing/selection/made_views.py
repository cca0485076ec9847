"""Views and Gaussians that the tests of selecting share, and a slow projection that knows nothing of the kernels."""

from __future__ import annotations

import numpy as np

from engine.camera.rotations import matrices_of
from engine.editing.selection.seen_from import SeenFrom

SIZE = (48, 36)


def view_at(distance: float = 4.0, *, focal: float = 40.0, near: float = 0.01, set_back: float = 0.0) -> SeenFrom:
    """Looks along z at the origin from that far away; farther by set_back, with a lens as much longer."""
    pose = np.eye(4)
    pose[2, 3] = distance + set_back
    longer = focal * (distance + set_back) / distance
    K = np.array([[longer, 0.0, SIZE[0] / 2], [0.0, longer, SIZE[1] / 2], [0.0, 0.0, 1.0]])
    return SeenFrom(pose, K, *SIZE, near=near, set_back=set_back)


def scattered(n: int, seed: int = 0, spread: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """means, quats, scales and opacities; some behind the camera. float32"""
    rng = np.random.default_rng(seed)
    means = rng.normal(0.0, spread, (n, 3)) * [1.5, 1.0, 3.0]
    quats, scales = rng.normal(size=(n, 4)), np.exp(rng.normal(-2.5, 0.7, (n, 3)))
    arrays = means, quats, scales, rng.uniform(0.05, 1.0, n)
    return tuple(array.astype(np.float32) for array in arrays)  # pyright: ignore[reportReturnType]


def slow_spread(mean: np.ndarray, quat: np.ndarray, scale: np.ndarray, view: SeenFrom) -> tuple[np.ndarray, np.ndarray]:
    """Pixel and depth [3] and their covariance [3, 3] of one Gaussian, by numerical derivatives of the lens."""
    rotation = matrices_of(quat.astype(np.float64) / np.linalg.norm(quat))
    spread = rotation @ np.diag(scale.astype(np.float64) ** 2) @ rotation.T

    def seen(point: np.ndarray) -> np.ndarray:
        x, y, z = view.world_to_camera[:3, :3] @ point + view.world_to_camera[:3, 3]
        return np.array([view.K[0, 0] * x / z + view.K[0, 2], view.K[1, 1] * y / z + view.K[1, 2], z])

    step = 1e-5
    mean = mean.astype(np.float64)
    jacobian = np.stack([(seen(mean + d) - seen(mean - d)) / (2 * step) for d in step * np.eye(3)], axis=1)
    return seen(mean), jacobian @ spread @ jacobian.T
