"""`tile_boxes`: which tiles of a picture a Gaussian may touch, without drawing it.

The box is that of the rasterizer, so a tile outside of it holds no trace of the Gaussian: not in the image and not in
a gradient. "cpu" runs the rasterizer's own projection, "reference" is plain torch in any dtype.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from engine.argument_checks import require_tensor
from engine.raster.cpu.tile_boxes import covered_tiles, meeting_rows, tile_boxes_cpu
from engine.raster.gaussians import Gaussians
from engine.raster.pinhole_view import TILE_PX, PinholeView, n_tiles, pinhole_views
from engine.raster.rasterize import check_gaussians
from engine.raster.reference import drawable_rows, pixel_boxes, project


@dataclass(frozen=True, slots=True)
class TileBoxes:
    """Boxes of tiles in one picture.

    Attributes:
        packed: First and last tile column, first and last tile row, first | last << 16 each; the last is smaller than
            the first where a Gaussian is not drawn. [N, 2] int32
        shape: Rows and columns of tiles of the picture.
    """

    packed: np.ndarray
    shape: tuple[int, int]

    def mask(self) -> np.ndarray:
        """Tiles under any box. [rows, columns] bool"""
        return covered_tiles(self.packed, self.shape)

    def drawn(self) -> np.ndarray:
        """Gaussians that have a box, ascending. [n] int64"""
        return ((self.packed[:, 0] >> 16) >= (self.packed[:, 0] & 0xFFFF)).nonzero()[0]

    def meeting(self, tile_mask: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Those of `rows`, one a box, whose box holds a tile of the mask; in order.

        Args:
            tile_mask: [rows, columns] bool
            rows: [N] int64
        Returns:
            [n] int64
        Raises:
            ValueError, TypeError: Shape or dtype of an argument does not fit; the message names it.
        """
        if tile_mask.shape != self.shape or tile_mask.dtype != np.bool_:
            raise ValueError(
                f"tile_mask must be bool {list(self.shape)}, got {tile_mask.dtype} {list(tile_mask.shape)}"
            )
        if rows.shape != (len(self.packed),):
            raise ValueError(
                f"rows must be {[len(self.packed)]} to match boxes {list(self.packed.shape)}, got {list(rows.shape)}"
            )
        return meeting_rows(self.packed, tile_mask, rows)


def tile_boxes(
    gaussians: Gaussians,
    viewmat: Tensor,
    K: Tensor,
    width: int,
    height: int,
    *,
    near_plane: float = 0.01,
    backend: str = "auto",
) -> TileBoxes:
    """Tiles that Gaussians may touch in one picture. Arguments as in `engine.raster.rasterize`, of one camera.

    Args:
        viewmat: [4, 4]
        K: [3, 3]
        backend: "cpu" (float32 tensors in main memory), "reference", or "auto": cpu if it can.
    Raises:
        TypeError, ValueError: An argument does not fit; the message names it.
    """
    check_gaussians(gaussians)
    for name, matrix in (("viewmat", viewmat), ("K", K)):
        require_tensor(name, matrix)
    (view,) = pinhole_views(viewmat[None], K[None], width, height, near_plane)
    means = gaussians.means
    is_fast = means.dtype == torch.float32 and means.device.type == "cpu"
    if backend == "auto":
        backend = "cpu" if is_fast else "reference"
    if backend not in _BACKENDS:
        raise ValueError(f"backend must be auto or one of {', '.join(sorted(_BACKENDS))}, got {backend!r}")
    if backend == "cpu" and not is_fast:
        raise TypeError(f"backend 'cpu' needs float32 tensors on the cpu, got means {means.dtype} on {means.device}")
    return TileBoxes(_BACKENDS[backend](gaussians, view), n_tiles(view.width, view.height))


def _tile_boxes_reference(gaussians: Gaussians, view: PinholeView) -> np.ndarray:
    gaussians = gaussians.detach()
    packed = torch.ones(len(gaussians), 2, dtype=torch.int32)
    rows = drawable_rows(gaussians, view)
    drawn = gaussians[rows]
    centers, covariances, _ = project(drawn, view)
    first, last, _ = pixel_boxes(centers, covariances, drawn.opacities, view)
    tiles = [(pixels / TILE_PX).floor().to(torch.int32) for pixels in (first, last)]
    packed[rows] = (tiles[0] | tiles[1] << 16).cpu()
    return packed.numpy()


_BACKENDS = {"cpu": tile_boxes_cpu, "reference": _tile_boxes_reference}
