"""Activations: the fused back end against torch in float64, forward and gradient, hard values included."""

from typing import Any

import numpy as np
import pytest
import torch
from numba import njit

from engine.model.activation import activate
from engine.model.fast_exp import exp_float32

K = 5


def make_inputs(n: int, *, spread: float, seed: int = 0) -> dict[str, Any]:
    generator = torch.Generator().manual_seed(seed)

    def normal(*size: int) -> torch.Tensor:
        return torch.randn(*size, generator=generator)

    return {
        "raw": spread * normal(n, 14 * K),
        "positions": normal(n, 3),
        "color_logits": normal(n, 3),
        "log_offset_scales": normal(n, 3) - 3,
        "log_base_scales": normal(n, 3) - 3,
    }


@pytest.mark.parametrize("spread", [1.0, 30.0])
def test_fused_matches_reference_forward_and_gradient(spread):
    fast, slow = make_inputs(40, spread=spread), make_inputs(40, spread=spread)
    learned = ("raw", "log_offset_scales", "log_base_scales")
    slow = {name: tensor.double() for name, tensor in slow.items()}
    for name in learned:
        fast[name].requires_grad_(True)
        slow[name].requires_grad_(True)
    outputs = [
        activate(**inputs, gaussians_per_anchor=K, backend=backend)
        for inputs, backend in ((fast, "fused"), (slow, "reference"))
    ]
    generator = torch.Generator().manual_seed(1)
    weights = [torch.randn(t.shape, generator=generator) for t in outputs[0].tensors()]
    for gaussians in outputs:
        total = sum((t * w.to(t.dtype)).sum() for t, w in zip(gaussians.tensors(), weights, strict=True))
        assert isinstance(total, torch.Tensor)
        total.backward()
    for ours, truth in zip(outputs[0].tensors(), outputs[1].tensors(), strict=True):
        assert (ours - truth).abs().max() < 1e-6 * max(1.0, truth.abs().max().item())  # a few float32 roundings
    for name in learned:
        ours, truth = fast[name].grad, slow[name].grad
        assert ours is not None
        assert truth is not None
        assert (ours - truth).norm() < 1e-6 * truth.norm()  # worst seen 2e-7


def test_no_anchors_give_no_gaussians():
    assert len(activate(**make_inputs(0, spread=1.0), gaussians_per_anchor=K)) == 0


def test_a_bad_row_stays_alone():
    inputs = make_inputs(6, spread=1.0)
    inputs["raw"][2] = float("nan")
    inputs["raw"][4, :3] = float("inf")
    gaussians = activate(**inputs, gaussians_per_anchor=K)
    is_bad_row = torch.isnan(gaussians.colors).any(1).reshape(6, K).any(1)
    assert is_bad_row.tolist() == [False, False, True, False, False, False]
    assert torch.isfinite(gaussians.opacities.reshape(6, K)[4]).all()  # sigmoid of infinity is 1


@njit
def _exp_all(values, out):
    for i in range(len(values)):
        out[i] = exp_float32(values[i])


def test_exp_is_accurate_over_its_range():
    values = np.concatenate([np.linspace(-87, 88, 20001), [0.0, -0.0, 1e-30, np.nan]]).astype(np.float32)
    out = np.empty_like(values)
    _exp_all(values, out)
    truth = np.exp(values.astype(np.float64))
    assert np.isnan(out[-1])
    assert np.abs(out[:-1] / truth[:-1] - 1).max() < 2e-7
