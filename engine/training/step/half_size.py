"""A clip's pictures and cameras at half size, for the first steps of a phase: coarse to fine.

Truth is the mean of two by two pixels, rounded to bytes; an odd last row or column is left out. The rasterizer's
low-pass has a fixed width in pixels, so what is drawn at half size looks wider than it is; the steps at full size that
follow take it back.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from engine.camera.rig import CameraRig
from engine.images.image_filters import block_mean
from engine.training.step.visible_anchors import camera_views


class HalfSize:
    """Truths of one phase at half size, made when first drawn and kept: a quarter of the memory of its pictures.

    Args:
        rig: All cameras of the capture, of one size.
        near_plane: Nearest depth that is drawn, scene units.

    Attributes:
        views: Of all cameras.
    """

    def __init__(self, rig: CameraRig, *, near_plane: float) -> None:
        even = replace(rig, image_sizes=rig.image_sizes // 2 * 2)
        half = even.resized(even.image_sizes // 2)
        self.views = camera_views(half, near_plane=near_plane)
        self._truths: dict[int, tuple[np.ndarray, np.ndarray | None]] = {}

    def truth(
        self, item: int, pixels: np.ndarray, is_counted: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """A truth at half size, and which of its pixels count: those of which every part does.

        Args:
            item: Its number in this phase, by which the result is kept: the same pixels every time.
            pixels: At full size. [H, W, 3] uint8
            is_counted: [H, W] bool, or None for all.
        """
        if item not in self._truths:
            counted = None if is_counted is None else block_mean(is_counted, 2) == 1.0
            self._truths[item] = np.rint(block_mean(pixels, 2)).astype(np.uint8), counted
        return self._truths[item]
