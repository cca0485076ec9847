"""Compile, or load from the cache, every kernel of a training step outside model and rasterizer: loss and optimiser."""

from __future__ import annotations

import numpy as np
import torch
from torch import nn


def warm_up() -> None:
    """One tiny loss with everything it knows, squares of tiles, and one step of Adam.

    About ten seconds of one core when nothing is cached (holding the interpreter lock), a tenth of a second after, plus
    half a second if these are the first kernels of the process.
    """
    from engine.training.optimizer.adam import make_adam
    from engine.training.step.losses import photometric_loss
    from engine.training.step.tile_squares import tile_squares

    image, gain = nn.Parameter(torch.full((8, 8, 3), 0.5)), nn.Parameter(torch.ones(3))
    truth = np.zeros((8, 8, 3), np.uint8)
    result = photometric_loss(image, truth, ssim_weight=0.2, gain=gain)
    result.loss.backward()
    tile_squares(image.detach().numpy(), truth, gain.detach().numpy())
    gradients = {"image": torch.ones(8, 8, 3)}
    adam = make_adam({"image": image.detach()})
    adam.norm(gradients)
    adam.update(gradients, {"image": 0.0}, 1.0)
