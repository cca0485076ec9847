"""Gaussians to pictures: one public call for every back end, with its checks and values."""

from engine.raster.gaussians import Gaussians
from engine.raster.pinhole_view import TILE_PX
from engine.raster.rasterize import rasterize, tile_boxes
from engine.raster.rendering import Rendering
from engine.raster.tile_boxes import TileBoxes

__all__ = ["TILE_PX", "Gaussians", "Rendering", "TileBoxes", "rasterize", "tile_boxes"]
