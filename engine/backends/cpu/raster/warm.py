"""Compile, or load from the cache, every kernel of the fast back end."""

from __future__ import annotations

import torch

from engine.raster.gaussians import Gaussians


def warm_up() -> None:
    """Render and differentiate a tiny scene once.

    About ten seconds of one core when nothing is cached (holding the interpreter lock), a fraction of a second after.
    """
    from engine.backends.cpu.backend import CpuBackend
    from engine.raster.rasterize import rasterize, tile_boxes

    n_rows = 4
    gaussians = Gaussians(
        means=torch.tensor([[0.0, 0.0, 2.0]]).repeat(n_rows, 1),
        quats=torch.tensor([[1.0, 0.0, 0.0, 0.0]]).repeat(n_rows, 1),
        scales=torch.full((n_rows, 3), 0.5),
        opacities=torch.full((n_rows,), 0.5),
        colors=torch.full((n_rows, 3), 0.5),
    )
    for tensor in gaussians.tensors():
        tensor.requires_grad_()
    K = torch.tensor([[[8.0, 0.0, 4.0], [0.0, 8.0, 4.0], [0.0, 0.0, 1.0]]])
    rendering = rasterize(gaussians, torch.eye(4)[None], K, 8, 8, backend=CpuBackend())
    rendering.image.sum().backward()
    boxes = tile_boxes(gaussians, torch.eye(4), K[0], 8, 8, backend=CpuBackend())
    boxes.meeting(boxes.mask(), boxes.drawn())
