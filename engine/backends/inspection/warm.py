"""Compile, or load from the cache, the kernels of pictures that explain."""

from __future__ import annotations

import numpy as np
import torch

from engine.backends.inspection.ellipsoids import ellipsoids
from engine.backends.inspection.overdraw import overdraw
from engine.raster.gaussians import Gaussians
from engine.raster.pinhole_view import PinholeView


def warm_up() -> None:
    """Run every kernel once, on one Gaussian and a picture of a few pixels."""
    one = Gaussians(
        torch.tensor([[0.0, 0.0, 2.0]]),
        torch.tensor([[1.0, 0.0, 0.0, 0.0]]),
        torch.full((1, 3), 0.2),
        torch.tensor([0.9]),
        torch.full((1, 3), 0.5),
    )
    view = PinholeView(np.eye(3), np.zeros(3), 8.0, 8.0, 4.0, 4.0, 8, 8, 0.01)
    overdraw(one, view)
    ellipsoids(one, view, (0.0, 0.0, 0.0))
