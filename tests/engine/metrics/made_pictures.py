"""Pictures to compare: a smooth scene with an edge, and the same disturbed."""

import numpy as np


def scene(height: int, width: int, *, seed: int = 0) -> np.ndarray:
    """Waves of three colours and a bright square, in 0..1. [H, W, 3] float32"""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:height, 0:width] / 20.0
    phases = rng.uniform(0, 6, 3)
    picture = np.stack([0.5 + 0.3 * np.sin(x * (i + 1) + phases[i]) * np.cos(y) for i in range(3)], axis=-1)
    picture[height // 4 : height // 2, width // 4 : width // 2] += 0.3
    return np.clip(picture + 0.02 * rng.standard_normal(picture.shape), 0, 1).astype(np.float32)


def disturbed(truth: np.ndarray, *, amount: float = 0.05, seed: int = 1) -> np.ndarray:
    """The picture with noise and a shift of one pixel, in 0..1."""
    noise = amount * np.random.default_rng(seed).standard_normal(truth.shape)
    return np.clip(np.roll(truth, 1, axis=1) + noise, 0, 1).astype(np.float32)
