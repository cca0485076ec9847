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
        is_frozen: Rows whose gradient nobody needs: drawn like any other, but their gradient is zero and costs no
            work. None where no row is frozen. [N] bool
    """

    means: Tensor
    quats: Tensor
    scales: Tensor
    opacities: Tensor
    colors: Tensor
    is_frozen: Tensor | None = None

    def __len__(self) -> int:
        return self.means.shape[0]

    def __getitem__(self, rows: Tensor | slice) -> Gaussians:
        """The chosen rows, in the given order."""
        is_frozen = None if self.is_frozen is None else self.is_frozen[rows]
        return Gaussians(*(tensor[rows] for tensor in self.tensors()), is_frozen=is_frozen)

    def tensors(self) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
        """means, quats, scales, opacities, colors: what a gradient can flow to."""
        return self.means, self.quats, self.scales, self.opacities, self.colors

    def detach(self) -> Gaussians:
        """The same values without history."""
        return Gaussians(*(tensor.detach() for tensor in self.tensors()), is_frozen=self.is_frozen)

    def to(self, device: torch.device, dtype: torch.dtype) -> Gaussians:
        """The same values elsewhere; frozen rows are no longer marked."""
        return Gaussians(*(tensor.to(device, dtype) for tensor in self.tensors()))

    @staticmethod
    def concatenate(parts: list[Gaussians]) -> Gaussians:
        """All parts one after another; the parts keep their rows in order."""
        is_frozen = None
        if any(part.is_frozen is not None for part in parts):
            is_frozen = torch.cat([part.frozen_rows() for part in parts])
        columns = (torch.cat(tensors) for tensors in zip(*(part.tensors() for part in parts), strict=True))
        return Gaussians(*columns, is_frozen=is_frozen)

    def frozen_rows(self) -> Tensor:
        """`is_frozen`, all False where it is None. [N] bool"""
        if self.is_frozen is not None:
            return self.is_frozen
        return torch.zeros(len(self), dtype=torch.bool, device=self.means.device)
