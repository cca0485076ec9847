"""Volume term against plain torch in float64."""

from __future__ import annotations

import pytest
import torch

from engine.backends.cpu.step.volume import volume_sum


@pytest.mark.parametrize("n", [0, 1, 500])
def test_value_and_gradient_are_those_of_torch(n):
    scales = (0.1 * torch.rand(n, 3, generator=torch.Generator().manual_seed(0))).requires_grad_()
    slow = scales.detach().double().requires_grad_()
    (0.5 * volume_sum(scales, 0.02)).backward()
    (0.5 * (slow / 0.02).prod(1).sum()).backward()
    assert float(volume_sum(scales, 0.02).detach()) == pytest.approx(
        float((slow / 0.02).prod(1).sum().detach()), rel=1e-6
    )
    assert scales.grad is not None
    assert slow.grad is not None
    assert torch.allclose(scales.grad.double(), slow.grad, rtol=1e-6, atol=0)
