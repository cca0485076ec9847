"""Warming up compiles everything: no later call compiles a kernel again, whatever it is given."""

from typing import Any

import numpy as np
import torch
from torch import nn

from engine.kernels import routines
from engine.training.config import TrainConfig
from engine.training.optimizer.optimizer import PhaseOptimizer
from engine.training.step.fused_loss import tile_grid
from engine.training.step.losses import photometric_loss
from engine.training.warm import warm_up


def test_warm_up_leaves_nothing_to_compile():
    warm_up()
    compiled = set(routines._compiled)
    assert {name for name in routines._defined if name.startswith("engine.training.")} <= compiled
    bytes_truth = np.random.default_rng(0).integers(0, 256, (40, 50, 3), dtype=np.uint8)
    frozen = bytes_truth.copy()
    frozen.setflags(write=False)
    mask = np.ones((50, 40), bool).T
    for truth in (bytes_truth, frozen[:, :40], bytes_truth.astype(np.float32) / np.float32(255)):
        height, width = truth.shape[:2]
        choices: tuple[dict[str, Any], ...] = (
            {},
            {"gain": torch.ones(3)},
            {"is_counted": mask[:, :width], "tile_mask": np.ones(tile_grid(height, width), bool)},
        )
        for options in choices:
            photometric_loss(torch.rand(3, height, width).permute(1, 2, 0), truth, ssim_weight=0.2, **options)
    parameters = {"large": (nn.Parameter(torch.zeros(40_000)), 0.1), "small": (nn.Parameter(torch.zeros(2, 3)), 0.1)}
    optimizer = PhaseOptimizer(parameters, n_steps=2, config=TrainConfig(max_gradient_norm=1.0), final_ratios={})
    optimizer.step()
    for parameter, _ in parameters.values():
        parameter.grad = torch.ones(parameter.shape)
    optimizer.step()
    assert set(routines._compiled) == compiled
