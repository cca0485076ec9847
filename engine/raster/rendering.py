"""Rendering: what `rasterize` returns."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True, slots=True)
class Rendering:
    """Pictures of one or several cameras.

    Attributes:
        image: Colours over the background. [C, H, W, 3]
        alpha: One minus the transmittance behind the last Gaussian. [C, H, W, 1]
        means2d: Projected centres in pixels, (0, 0) where a Gaussian is not drawn; a leaf whose `.grad` holds the
            gradient in pixels after a backward pass. None unless `want_means2d`. [C, N, 2]
        depth: Sum over the Gaussians of weight times camera depth of the centre, scene units. Not divided by alpha:
            see `expected_depth`. None unless `want_depth`. [C, H, W, 1]
    """

    image: Tensor
    alpha: Tensor
    means2d: Tensor | None = None
    depth: Tensor | None = None

    @property
    def expected_depth(self) -> Tensor | None:
        """depth / alpha, 0 where alpha is 0; None without depth. [C, H, W, 1]"""
        if self.depth is None:
            return None
        is_hit = self.alpha > 0
        return torch.where(is_hit, self.depth / torch.where(is_hit, self.alpha, 1.0), 0.0)
