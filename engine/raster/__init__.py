"""Rasterizers for Gaussians: one public op, a readable reference and a fast path for the CPU."""

from engine.raster.gaussians import Gaussians
from engine.raster.pinhole_view import TILE_PX
from engine.raster.rasterize import rasterize
from engine.raster.rendering import Rendering
from engine.raster.tile_boxes import TileBoxes, tile_boxes

__all__ = ["TILE_PX", "Gaussians", "Rendering", "TileBoxes", "rasterize", "tile_boxes"]
