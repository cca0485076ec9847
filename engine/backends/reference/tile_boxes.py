"""Tile boxes in plain torch: those of the reference rasterizer."""

from __future__ import annotations

import torch

from engine.backends.reference.raster import drawable_rows, pixel_boxes, project
from engine.raster.gaussians import Gaussians
from engine.raster.pinhole_view import TILE_PX, PinholeView, n_tiles
from engine.raster.tile_boxes import TileBoxes


def tile_boxes_reference(gaussians: Gaussians, view: PinholeView) -> TileBoxes:
    """Boxes of checked Gaussians, any dtype and device."""
    gaussians = gaussians.detach()
    packed = torch.ones(len(gaussians), 2, dtype=torch.int32, device=gaussians.means.device)
    rows = drawable_rows(gaussians, view)
    drawn = gaussians[rows]
    centers, covariances, _ = project(drawn, view)
    first, last, _ = pixel_boxes(centers, covariances, drawn.opacities, view)
    tiles = [(pixels / TILE_PX).floor().to(torch.int32) for pixels in (first, last)]
    packed[rows] = tiles[0] | tiles[1] << 16
    return TileBoxes(packed, n_tiles(view.width, view.height))
