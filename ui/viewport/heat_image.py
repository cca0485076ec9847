"""A heat map as a picture on the GPU, and the value at a place of it. Knows no ImGui."""

from __future__ import annotations

import math
from collections.abc import Hashable

import moderngl
import numpy as np

from app.playback.modes.color_maps import mapped
from app.playback.modes.hatching import hatched
from ui.gl import ImageTexture


class HeatImage:
    """Owns one texture. GL thread only."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._image = ImageTexture(ctx)

    @property
    def texture(self) -> moderngl.Texture:
        """Texture of the image last given to `set`."""
        return self._image.texture

    def set(self, values: np.ndarray, map_name: str, low: float, high: float, *, key: Hashable) -> None:
        """Take up other values.

        Args:
            values: [H, W]; hatched where they are not numbers.
            map_name, low, high: See app.playback.modes.color_maps.mapped.
            key: Differs whenever the values do.
        """
        whole = (key, map_name, low, high)
        if whole != self._image.key:
            self._image.set(hatched(mapped(values, map_name, low, high), ~np.isnan(values)), key=whole)

    def release(self) -> None:
        """Free the texture."""
        self._image.release()


def value_at(values: np.ndarray, across: float, down: float) -> float | None:
    """The value at a place given as shares of width and height; None outside, and where it is not a number.

    Args:
        values: [H, W]
    """
    if not (0.0 <= across < 1.0 and 0.0 <= down < 1.0):
        return None
    height, width = values.shape
    value = float(values[int(down * height), int(across * width)])
    return None if math.isnan(value) else value
