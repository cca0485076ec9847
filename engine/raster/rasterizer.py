"""Rasterizer: the part of a back end that draws Gaussians (engine.backends)."""

from __future__ import annotations

from typing import Protocol

import torch
from torch import Tensor

from engine.raster.gaussians import Gaussians
from engine.raster.pinhole_view import PinholeView
from engine.raster.rendering import Rendering
from engine.raster.tile_boxes import TileBoxes


class Rasterizer(Protocol):
    """The receiver of the checked arguments of `rasterize` and `tile_boxes`.

    Raises a TypeError that names the tensor where dtype or device are not those it can work with.
    """

    @property
    def device(self) -> torch.device:
        """Where tensors that are made for this back end lie."""
        ...

    @property
    def dtype(self) -> torch.dtype:
        """Floating dtype of tensors that are made for this back end."""
        ...

    def rasterize(
        self,
        gaussians: Gaussians,
        views: list[PinholeView],
        background: Tensor,
        *,
        tile_mask: Tensor | None,
        want_means2d: bool,
        want_depth: bool,
    ) -> Rendering:
        """Render every view. tile_mask: [C, rows, columns] bool; background: [3] like the Gaussians' means"""
        ...

    def tile_boxes(self, gaussians: Gaussians, view: PinholeView) -> TileBoxes:
        """Tiles that Gaussians may touch in one view."""
        ...
