"""A step that is not finite says which part, where, and what to change."""

import math

import pytest
import torch

from engine.errors import NonFiniteLoss
from engine.training.config import TrainConfig
from engine.training.step.nonfinite import advice, gradient_not_finite, loss_not_finite

CONFIG = TrainConfig()


@pytest.mark.parametrize(
    ("photometric", "volume", "n_bad", "said"),
    [
        (math.nan, 0.1, 2, "The photometric loss became nan at step 3; 2 of 12 rendered values are not finite."),
        (math.inf, 0.1, 0, "The photometric loss became inf at step 3."),
        (0.1, math.nan, 0, "The volume term of the loss became nan at step 3"),
        (3e38, 3e38, 0, "The loss overflowed at step 3: photometric 3e+38, volume 3e+38."),
    ],
)
def test_the_part_of_the_loss_that_is_no_number_is_named(photometric, volume, n_bad, said):
    image = torch.zeros(2, 2, 3)
    image.view(-1)[:n_bad] = math.nan
    error = loss_not_finite(image=image, photometric=photometric, volume=volume, where="step 3", config=CONFIG)
    assert error.message.startswith(said)
    assert error.hint == advice(CONFIG)


def test_a_gradient_is_told_with_its_step():
    error = gradient_not_finite(NonFiniteLoss("The gradient of x is nan."), where="step 3", config=CONFIG)
    assert error.message == "The gradient of x is nan at step 3."


def test_what_is_advised_is_milder_than_what_failed_and_can_be_set():
    config = TrainConfig(table_lr=0.02, max_gradient_norm=5.0)
    assert "--set table_lr=0.01 or --set max_gradient_norm=0.5." in advice(config)
    assert "max_gradient_norm=1." in advice(TrainConfig(max_gradient_norm=0.0))
