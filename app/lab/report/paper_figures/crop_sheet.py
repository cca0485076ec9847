"""Windows cut out of pictures, side by side and pixel by pixel: whole-number enlargement, nothing between pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image

from app.lab.figures import DPI, new_figure, plain_texts, png_of
from app.lab.report.charts import shortened
from app.lab.report.paper_figures.by_hand import InsetWindow

SHEET_WIDTH_PX = 1080
"""As wide as the page shows without making it smaller."""
TILE_PX = 190
"""Longer side of an enlarged window, at most; a window that is larger is shown as it is."""
_GAP_PX, _TITLE_PX = 8, 32
_BOX_COLOR = (224, 0, 0)


@dataclass(frozen=True, slots=True)
class Tile:
    """One window. pixels: [h, w, 3] uint8"""

    title: str
    said: str
    pixels: np.ndarray


@dataclass(frozen=True, slots=True)
class Sheet:
    """The file, and how many times as large its windows are."""

    png: bytes
    n_times: int


def draw_crops(truth: np.ndarray, window: InsetWindow, tiles: Sequence[Tile]) -> Sheet:
    """A small overview of the whole picture with a red box, and the windows in rows next to it.

    Args:
        truth: The whole picture. [H, W, 3] uint8
        window: Where the box stands.
    """
    n_times = max(TILE_PX // max(window.width, window.height), 1)
    tile_width, tile_height = window.width * n_times, window.height * n_times
    overview = _overview(truth, window)
    left = overview.shape[1] + 2 * _GAP_PX
    n_columns = max((SHEET_WIDTH_PX - left) // (tile_width + _GAP_PX), 1)
    n_rows = -(-len(tiles) // n_columns)
    n_columns = -(-len(tiles) // n_rows)
    width = left + n_columns * (tile_width + _GAP_PX)
    height = max(n_rows * (tile_height + _TITLE_PX + _GAP_PX), overview.shape[0] + _TITLE_PX + _GAP_PX)
    sheet = np.full((height, width, 3), 255, np.uint8)
    titles = [(_GAP_PX, 0, f"camera {window.camera}", f"frame {window.frame_index}")]
    _put(sheet, overview, _GAP_PX, _TITLE_PX)
    for i, tile in enumerate(tiles):
        row, column = divmod(i, n_columns)
        x, y = left + column * (tile_width + _GAP_PX), row * (tile_height + _TITLE_PX + _GAP_PX)
        _put(sheet, tile.pixels.repeat(n_times, 0).repeat(n_times, 1), x, y + _TITLE_PX)
        titles.append((x, y, shortened(tile.title), tile.said))
    with plain_texts():
        figure = new_figure(width / DPI, height / DPI)
        figure.set_layout_engine("none")
        figure.figimage(sheet, 0, 0)
        for x, y, title, said in titles:
            place = {"ha": "left", "va": "top", "fontsize": 7.5}
            figure.text((x + 1) / width, 1 - (y + 2) / height, title, **place)
            figure.text((x + 1) / width, 1 - (y + 16) / height, said, color="#555555", **place)
        return Sheet(png_of(figure), n_times)


def _overview(truth: np.ndarray, window: InsetWindow) -> np.ndarray:
    """The picture as wide as a tile and a half, with a red box on a white one, which is seen on every ground."""
    height, width = truth.shape[:2]
    scale = min(1.5 * TILE_PX / max(width, height), 1.0)
    size = (max(round(width * scale), 1), max(round(height * scale), 1))
    small = np.array(Image.fromarray(truth).resize(size, Image.Resampling.LANCZOS))
    x, y = round(window.x * scale), round(window.y * scale)
    right, bottom = round((window.x + window.width) * scale), round((window.y + window.height) * scale)
    for grown_px, color in ((2, (255, 255, 255)), (1, _BOX_COLOR), (0, _BOX_COLOR)):
        _outline(small, x - grown_px, y - grown_px, right + grown_px, bottom + grown_px, color)
    return small


def _outline(picture: np.ndarray, x: int, y: int, right: int, bottom: int, color: tuple[int, int, int]) -> None:
    """A rectangle one pixel wide, as far as it lies inside. right, bottom: One past its last pixels."""
    height, width = picture.shape[:2]
    x, y, right, bottom = max(x, 0), max(y, 0), min(right, width), min(bottom, height)
    picture[y:bottom, [x, right - 1]] = color
    picture[[y, bottom - 1], x:right] = color


def _put(sheet: np.ndarray, picture: np.ndarray, x: int, y: int) -> None:
    sheet[y : y + picture.shape[0], x : x + picture.shape[1]] = picture
