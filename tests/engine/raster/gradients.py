"""What tests ask of gradients."""

from __future__ import annotations

from torch import Tensor

from engine.raster import Gaussians


def gradient(tensor: Tensor | None) -> Tensor:
    """The gradient of a tensor that must have one."""
    assert tensor is not None
    assert tensor.grad is not None
    return tensor.grad


def gradients(gaussians: Gaussians) -> list[Tensor]:
    """Copies of the gradients of all five parameters."""
    return [gradient(tensor).clone() for tensor in gaussians.tensors()]
