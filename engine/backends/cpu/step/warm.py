"""Compile, or load from the cache, every kernel of a training step outside model and rasterizer: loss and optimiser."""

from __future__ import annotations

import torch
from torch import nn


def warm_up() -> None:
    """One tiny loss with everything it knows, squares of tiles, and one step of Adam.

    About ten seconds of one core when nothing is cached (holding the interpreter lock), a tenth of a second after, plus
    half a second if these are the first kernels of the process.
    """
    from engine.backends.cpu.backend import CpuBackend

    cpu = CpuBackend()
    image, gain = nn.Parameter(torch.full((8, 8, 3), 0.5)), nn.Parameter(torch.ones(3))
    truth = torch.zeros(8, 8, 3, dtype=torch.uint8)
    result = cpu.photometric_loss(image, truth, ssim_weight=0.2, gain=gain, is_counted=None, tile_mask=None, rest=None)
    result.loss.backward()
    cpu.tile_squares(image, truth, gain)
    gradients = {"image": torch.ones(8, 8, 3)}
    adam = cpu.adam({"image": image.detach()})
    adam.step(gradients, {"image": 0.0}, max_norm=0.0, is_sound=torch.tensor(True))
