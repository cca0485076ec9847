"""Gaussians: everything a renderer ever sees of a scene, after activation."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True, slots=True)
class Gaussians:
    """Activated Gaussians in world space. A value; made fresh by every decode.

    Attributes:
        means: Centres, scene units. [N, 3]
        quats: Rotations wxyz; need not be unit length, rasterizers normalise. [N, 4]
        scales: Standard deviations along the rotated axes, scene units, linear. [N, 3]
        opacities: In 0..1. [N]
        colors: Display-encoded RGB in 0..1. [N, 3]
    """

    means: Tensor
    quats: Tensor
    scales: Tensor
    opacities: Tensor
    colors: Tensor

    def __len__(self) -> int:
        return self.means.shape[0]

    def __getitem__(self, rows: Tensor | slice) -> Gaussians:
        """The chosen rows, in the given order."""
        return Gaussians(*(tensor[rows] for tensor in self.tensors()))

    def tensors(self) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
        """means, quats, scales, opacities, colors."""
        return self.means, self.quats, self.scales, self.opacities, self.colors

    def detach(self) -> Gaussians:
        """The same values without history."""
        return Gaussians(*(tensor.detach() for tensor in self.tensors()))

    @staticmethod
    def concatenate(parts: list[Gaussians]) -> Gaussians:
        """All parts one after another; the parts keep their rows in order."""
        return Gaussians(*(torch.cat(tensors) for tensors in zip(*(p.tensors() for p in parts), strict=True)))
