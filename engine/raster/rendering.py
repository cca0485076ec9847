"""Rendering: what `rasterize` returns."""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor


@dataclass(frozen=True, slots=True)
class Rendering:
    """Pictures of one or several cameras.

    Attributes:
        image: Colours over the background. [C, H, W, 3]
        alpha: One minus the transmittance behind the last Gaussian. [C, H, W, 1]
        means2d: Projected centres in pixels, (0, 0) where a Gaussian is not drawn; a leaf whose `.grad` holds the
            gradient in pixels after a backward pass. None unless `want_means2d`. [C, N, 2]
    """

    image: Tensor
    alpha: Tensor
    means2d: Tensor | None = None
