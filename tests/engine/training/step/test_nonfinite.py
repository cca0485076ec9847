"""A step that is not finite says which part, where, and what to change."""

import math

import pytest

from engine.backends.phase import Fault
from engine.training.config import TrainConfig
from engine.training.step.nonfinite import advice, not_finite

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
    error = not_finite(Fault(photometric, volume, n_bad, 12), where="step 3", config=CONFIG)
    assert error.message.startswith(said)
    assert error.hint == advice(CONFIG)


def test_a_gradient_is_told_with_its_step():
    for names, said in ((("x", "y"), "x, y"), ((), "the sum")):
        error = not_finite(Fault(0.1, 0.0, 0, 12, True, names), where="step 3", config=CONFIG)
        assert error.message == f"The gradient of {said} is not finite at step 3."


def test_what_is_advised_is_milder_than_what_failed_and_can_be_set():
    config = TrainConfig(table_lr=0.02, max_gradient_norm=5.0)
    assert "--set table_lr=0.01 or --set max_gradient_norm=0.5." in advice(config)
    assert "max_gradient_norm=1." in advice(TrainConfig(max_gradient_norm=0.0))
