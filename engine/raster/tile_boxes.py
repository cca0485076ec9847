"""TileBoxes: which tiles of a picture Gaussians may touch."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import torch
from torch import Tensor


@dataclass(frozen=True, slots=True)
class TileBoxes:
    """Boxes of tiles in one picture, in plain torch; a back end may have a faster kind.

    Attributes:
        packed: First and last tile column, first and last tile row, first | last << 16 each; the last is smaller than
            the first where a Gaussian is not drawn. [N, 2] int32
        shape: Rows and columns of tiles of the picture.
    """

    packed: Tensor
    shape: tuple[int, int]

    def __getitem__(self, rows: Tensor | slice) -> Self:
        """The chosen boxes, in the given order."""
        return replace(self, packed=self.packed[rows])

    def drawn(self) -> Tensor:
        """Gaussians that have a box, ascending. [n] int64"""
        columns = self.packed[:, 0]
        return ((columns >> 16) >= (columns & 0xFFFF)).nonzero()[:, 0]

    def mask(self) -> Tensor:
        """Tiles under any box. [rows, columns] bool"""
        columns = self.packed[:, 0]
        is_drawn = ((columns >> 16) >= (columns & 0xFFFF)).long()
        left, right, top, bottom = (edge * is_drawn for edge in self._corners(self.packed))
        edges = torch.zeros(self.shape[0] + 1, self.shape[1] + 1, dtype=torch.int64, device=self.packed.device)
        for rows, columns, sign in ((top, left, 1), (top, right, -1), (bottom, left, -1), (bottom, right, 1)):
            edges.index_put_((rows, columns), sign * is_drawn, accumulate=True)
        return edges.cumsum(0).cumsum(1)[:-1, :-1] > 0

    def meeting(self, tile_mask: Tensor, rows: Tensor) -> Tensor:
        """The entries of `rows`, one a box, whose box holds a tile of the mask; in order.

        Args:
            tile_mask: [rows, columns] bool
            rows: [N] int64
        Returns:
            [n] int64
        Raises:
            ValueError, TypeError: Shape or dtype of an argument does not fit; the message names it.
        """
        if tile_mask.shape != self.shape or tile_mask.dtype != torch.bool:
            raise ValueError(
                f"tile_mask must be bool {list(self.shape)}, got {tile_mask.dtype} {list(tile_mask.shape)}"
            )
        if rows.shape != (len(self.packed),):
            raise ValueError(
                f"rows must be {[len(self.packed)]} to match boxes {list(self.packed.shape)}, got {list(rows.shape)}"
            )
        return self._meeting(tile_mask, rows)

    def _meeting(self, tile_mask: Tensor, rows: Tensor) -> Tensor:
        drawn = self.drawn()
        left, right, top, bottom = self._corners(self.packed[drawn])
        sums = torch.nn.functional.pad(tile_mask.long(), (1, 0, 1, 0)).cumsum(0).cumsum(1)
        n_wanted = sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left]
        return rows[drawn[n_wanted > 0]]

    @staticmethod
    def _corners(packed: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """First column, column behind the last, first row, row behind the last. [n] int64 each"""
        columns, rows = packed.long().unbind(1)
        return columns & 0xFFFF, (columns >> 16) + 1, rows & 0xFFFF, (rows >> 16) + 1
