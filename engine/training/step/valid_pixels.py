"""Which pixels of a training camera's pictures count: those that its lens reaches, the same in every frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from engine.raster.pinhole_view import TILE_PX


class ValidPixels:
    """The valid pixels of each window of each training camera, as a step needs them. Owns one flag a pixel.

    Windows that are seen as a whole have None everywhere, and their steps are as without this class.

    Args:
        is_valid: [H, W] bool each, or None where all cameras see all.
        device: Where steps are computed.
    """

    def __init__(self, is_valid: Sequence[np.ndarray] | None, device: torch.device | str) -> None:
        self._is_valid: list[Tensor | None] = []
        self._tiles: list[Tensor | None] = []
        self._shares: list[float] = []
        for flags in () if is_valid is None else is_valid:
            self._shares.append(float(flags.mean()))
            if flags.all():
                self._is_valid.append(None)
                self._tiles.append(None)
                continue
            valid = torch.from_numpy(flags).to(device)
            self._is_valid.append(valid)
            self._tiles.append(tiles_with_any(valid))

    def of(self, view_row: int) -> Tensor | None:
        """Pixels that count; None for all. [H, W] bool"""
        return self._is_valid[view_row] if self._is_valid else None

    def tiles_of(self, view_row: int) -> Tensor | None:
        """Tiles in which any pixel counts; None for all. [rows, columns] bool"""
        return self._tiles[view_row] if self._tiles else None

    def share_of(self, view_row: int) -> float:
        """Share of the pixels that count. view_row: of the window, engine.training.windows.Windows.row"""
        return self._shares[view_row] if self._shares else 1.0

    def shown(self, view_row: int, picture: Tensor) -> Tensor:
        """A picture [H, W, 3] as a captured one is: black where nothing counts."""
        valid = self.of(view_row)
        return picture if valid is None else picture * valid[..., None]


def tiles_with_any(is_counted: Tensor) -> Tensor:
    """Tiles in which any pixel of [H, W] bool is set. [rows, columns] bool"""
    height, width = is_counted.shape
    padded = functional.pad(is_counted, (0, -width % TILE_PX, 0, -height % TILE_PX))
    return padded.unflatten(1, (-1, TILE_PX)).unflatten(0, (-1, TILE_PX)).any(3).any(1)
