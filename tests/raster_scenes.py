"""Scenes of the raster tests (those of the benchmarks), and what tests ask of a gradient. No scene is made here."""

from __future__ import annotations

from torch import Tensor

from app.lab.bench.scenes import Scene, camera, gaussians_of, layered_scene, simple_scene
from engine.raster import Gaussians

__all__ = ["Scene", "camera", "gaussians_of", "gradient", "gradients", "layered_scene", "simple_scene"]


def gradient(tensor: Tensor | None) -> Tensor:
    """The gradient of a tensor that must have one."""
    assert tensor is not None
    assert tensor.grad is not None
    return tensor.grad


def gradients(gaussians: Gaussians) -> list[Tensor]:
    """Copies of the gradients of all five parameters."""
    return [gradient(tensor).clone() for tensor in gaussians.tensors()]
