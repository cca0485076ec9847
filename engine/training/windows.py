"""Windows: the parts that large pictures are cut into, one of which a training step draws and compares.

So the price of a step does not depend on the size of the picture. Pictures of up to WINDOW_PIXELS are one window.
A window is a picture of its own, of the same camera with another principal point; SSIM ends at its border as it does at
that of a picture.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:  # torch, which plans of trainings do without
    from engine.model.clip_view import View

TILE_PX = 32
"""Edge of the rasterizer's tiles."""

WINDOW_PIXELS = 640 * 480
"""Larger pictures are cut. The decode is half of a step at this size, and would be most of one in smaller windows."""
_WIDEST = 2.2
"""Ratio of a window's sides: narrower ones see many anchors of their surroundings."""


class Window(NamedTuple):
    """A part of a picture, pixels."""

    x: int
    y: int
    width: int
    height: int


class Windows:
    """The windows of pictures of one size, row by row. Their borders lie between tiles.

    Args:
        width, height: Of the pictures.
        max_pixels: Most pixels of a window, but for rounding to whole tiles.
    """

    def __init__(self, width: int, height: int, *, max_pixels: int = WINDOW_PIXELS) -> None:
        n_columns, n_rows = _division(width, height, max_pixels)
        xs, ys = _borders(width, n_columns), _borders(height, n_rows)
        self._windows = [Window(x, y, right - x, bottom - y) for y, bottom in pairwise(ys) for x, right in pairwise(xs)]

    def __len__(self) -> int:
        return len(self._windows)

    def __getitem__(self, index: int) -> Window:
        return self._windows[index]

    def row(self, camera_row: int, index: int) -> int:
        """Number of a camera's window among those of all cameras, as `views` lists them."""
        return camera_row * len(self) + index

    def view(self, whole: View, index: int) -> View:
        """The window as a camera sees it; the whole view where there is only one."""
        return whole if len(self) == 1 else whole.part(*self[index])

    def views(self, wholes: Sequence[View]) -> list[View]:
        """All windows of all cameras."""
        return [self.view(whole, index) for whole in wholes for index in range(len(self))]

    def cut(self, picture: np.ndarray, index: int) -> np.ndarray:
        """The window of a picture [H, W, ...]: the picture itself where there is only one, else a copy."""
        if len(self) == 1:
            return picture
        window = self[index]
        part = picture[window.y : window.y + window.height, window.x : window.x + window.width]
        return np.ascontiguousarray(part)

    def cut_all(self, pictures: np.ndarray | None) -> list[np.ndarray] | None:
        """All windows of a picture of each camera [C, H, W, ...]; None for None."""
        if pictures is None:
            return None
        return [self.cut(picture, index) for picture in pictures for index in range(len(self))]


def _division(width: int, height: int, max_pixels: int) -> tuple[int, int]:
    """Columns and rows: as few windows as possible of a good shape, then the squarest."""

    def badness(division: tuple[int, int]) -> tuple[bool, int, float]:
        w, h = width / division[0], height / division[1]
        ratio = max(w / h, h / w)
        return ratio > _WIDEST, division[0] * division[1], ratio

    most = 2 * -(-width * height // max_pixels)
    columns, rows = (range(1, max(min(most, side // TILE_PX), 1) + 1) for side in (width, height))
    fitting = [(c, r) for c in columns for r in rows if width * height <= max_pixels * c * r]
    return min(fitting, key=badness) if width * height > max_pixels and fitting else (1, 1)


def _borders(side: int, n: int) -> list[int]:
    """Where windows begin and the last one ends: whole tiles, as equal as they can be."""
    return [round(side * i / n / TILE_PX) * TILE_PX for i in range(n)] + [side]
