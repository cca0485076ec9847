"""Warming up compiles everything: no later call compiles a kernel again, whatever it is given."""

from typing import Any

import torch
from torch import nn

from engine.backends.cpu.step.warm import warm_up
from engine.backends.table import backend_called
from engine.kernels import routines
from engine.raster.pinhole_view import n_tiles
from engine.training.config import TrainConfig
from engine.training.optimizer.optimizer import PhaseOptimizer, schedule_of
from engine.training.step.losses import photometric_loss


def test_warm_up_leaves_nothing_to_compile():
    warm_up()
    compiled = set(routines._compiled)
    defined = {name for name in routines._defined if name.startswith("engine.backends.cpu.step.")}
    assert defined
    assert defined <= compiled
    bytes_truth = torch.randint(0, 256, (40, 50, 3), generator=torch.Generator().manual_seed(0), dtype=torch.uint8)
    mask = torch.ones(50, 40, dtype=torch.bool).T
    for truth in (bytes_truth, bytes_truth[:, :40], bytes_truth.float() / 255):
        height, width = truth.shape[:2]
        choices: tuple[dict[str, Any], ...] = (
            {},
            {"gain": torch.ones(3)},
            {"is_counted": mask[:, :width], "tile_mask": torch.ones(n_tiles(width, height), dtype=torch.bool)},
        )
        for options in choices:
            image = torch.rand(3, height, width).permute(1, 2, 0)
            photometric_loss(image, truth, backend=backend_called("cpu"), ssim_weight=0.2, **options)
    parameters = {"large": (nn.Parameter(torch.zeros(40_000)), 0.1), "small": (nn.Parameter(torch.zeros(2, 3)), 0.1)}
    schedule = schedule_of(parameters, TrainConfig(max_gradient_norm=1.0), n_steps=2)
    learning = {name: parameter for name, (parameter, _) in parameters.items()}
    optimizer = PhaseOptimizer(learning, schedule=schedule, backend=backend_called("cpu"))
    optimizer.step()
    for parameter, _ in parameters.values():
        parameter.grad = torch.ones(parameter.shape)
    optimizer.step()
    assert set(routines._compiled) == compiled
