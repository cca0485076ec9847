"""Scenes of random Gaussians and one camera, seeded: float64 values that float32 holds exactly."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from engine.raster.gaussians import Gaussians


@dataclass(frozen=True, slots=True)
class GaussianScene:
    """Gaussians and one camera; `arguments` are the positional arguments of `rasterize` after the Gaussians."""

    gaussians: Gaussians
    viewmats: Tensor
    Ks: Tensor
    width: int
    height: int
    background: Tensor
    near_plane: float = 0.01

    @property
    def arguments(self) -> tuple[Tensor, Tensor, int, int]:
        """viewmats, Ks, width and height, as `rasterize` takes them."""
        return self.viewmats, self.Ks, self.width, self.height


def camera(width: int, height: int, *, focal: float | None = None, center: tuple[float, float] | None = None) -> Tensor:
    """Ks of one camera. [1, 3, 3]"""
    focal = focal or 0.9 * width
    cx, cy = center or (width / 2, height / 2)
    return torch.tensor([[[focal, 0.0, cx], [0.0, focal, cy], [0.0, 0.0, 1.0]]], dtype=torch.float64)


def gaussians_of(
    means: np.ndarray,
    scales: np.ndarray,
    *,
    quats: np.ndarray | None = None,
    opacities: np.ndarray | None = None,
    colors: np.ndarray | None = None,
    seed: int = 1,
) -> Gaussians:
    """Float32-representable float64 Gaussians; arrays that are not given are random."""
    rng = np.random.default_rng(seed)
    n_rows = len(means)
    columns = (
        means,
        quats if quats is not None else rng.normal(size=(n_rows, 4)),
        scales,
        opacities if opacities is not None else rng.uniform(0.2, 0.9, n_rows),
        colors if colors is not None else rng.uniform(0, 1, (n_rows, 3)),
    )
    return Gaussians(*(torch.from_numpy(np.asarray(column, np.float32).copy()).double() for column in columns))


def simple_scene(gaussians: Gaussians, *, width: int = 160, height: int = 120, **changes: Any) -> GaussianScene:
    """The Gaussians seen by a camera at the origin."""
    values: dict[str, Any] = {
        "viewmats": torch.eye(4, dtype=torch.float64)[None],
        "Ks": camera(width, height),
        "background": torch.tensor([0.1, 0.2, 0.3], dtype=torch.float64),
    }
    return GaussianScene(gaussians=gaussians, width=width, height=height, **(values | changes))


def layered_scene(
    n_rows: int, width: int, height: int, size_px: float, *, faint: bool = False, seed: int = 0
) -> GaussianScene:
    """Gaussians spread over image and depth, log-normal anisotropic sizes, seen from a general pose.

    Args:
        size_px: Median standard deviation, pixels.
        faint: Opacities 0.02-0.3 instead of a logistic mix, so that many layers stay visible.
    """
    rng = np.random.default_rng(seed)
    focal = 0.9 * width
    z = rng.uniform(2, 10, n_rows)
    x = (rng.uniform(-0.05, 1.05, n_rows) - 0.5) * width / focal * z
    y = (rng.uniform(-0.05, 1.05, n_rows) - 0.5) * height / focal * z
    sizes = np.exp(rng.normal(math.log(size_px), 0.6, (n_rows, 1)) + rng.normal(0, 0.5, (n_rows, 3)))
    quats = rng.normal(size=(n_rows, 4))
    opacities = rng.uniform(0.02, 0.3, n_rows) if faint else 1 / (1 + np.exp(-rng.normal(0, 2, n_rows)))
    cosine, sine = math.cos(0.3), math.sin(0.3)
    pose = np.eye(4)
    pose[:3, :3] = [[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]]
    pose[:3, 3] = 0.1, -0.2, 0.5
    means = (np.stack([x, y, z], 1) - pose[:3, 3]) @ pose[:3, :3]
    gaussians = gaussians_of(
        means, sizes * z[:, None] / focal, quats=quats, opacities=opacities, colors=rng.uniform(0, 1, (n_rows, 3))
    )
    return simple_scene(gaussians, width=width, height=height, viewmats=torch.from_numpy(pose)[None])
