"""Frames of another size than their calibration: what becomes of K when they were made smaller, or cut off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

FrameFit = Literal["scaled", "cropped_end", "cropped_start", "cropped_middle"]
"""Made smaller, or cut off: at the right and lower border, at the left and upper one, or at both by the same."""
FITS: tuple[FrameFit, ...] = get_args(FrameFit)
FIT_WORDS: dict[FrameFit, str] = {
    "scaled": "which were scaled",
    "cropped_end": "which were cropped at the right and lower border",
    "cropped_start": "which were cropped at the left and upper border",
    "cropped_middle": "which were cropped equally on both sides",
}
SHAPE_TOLERANCE = 0.01
"""Share by which the sides of frames and calibration may differ in proportion without somebody saying why."""
ROUNDED_PX = 1.0
"""Encoders and scalers bring sides to whole, mostly even numbers."""


@dataclass(frozen=True, eq=False)
class OtherSize:
    """The calibration of a camera whose frames have another size.

    Attributes:
        K: At the calibrated size, pixel centres at +0.5. [3, 3]
        size: Width and height that it belongs to.
    """

    K: np.ndarray
    size: tuple[int, int]

    def cut_px(self, frames: tuple[int, int]) -> tuple[float, float]:
        """By how many pixels of the frames, in width and height, another shape than the calibrated one shows; 0, 0
        where one is a copy of the other at another size. frames: width and height of the frames."""
        scale = max(frames[0] / self.size[0], frames[1] / self.size[1])
        width, height = (side * scale - seen for side, seen in zip(self.size, frames, strict=True))
        return (0.0, 0.0) if max(width, height) <= ROUNDED_PX else (width, height)

    def is_far_off(self, frames: tuple[int, int]) -> bool:
        """Whether the frames are of so different a shape that they may be of another camera. frames: width, height."""
        return abs(frames[0] * self.size[1] / (frames[1] * self.size[0]) - 1.0) > SHAPE_TOLERANCE

    def fitted_K(self, frames: tuple[int, int], fit: FrameFit) -> np.ndarray:
        """K of the frames. [3, 3]"""
        cut = np.array(self.cut_px(frames))
        if fit == "scaled" or not cut.any():
            ratios = np.array(frames) / np.array(self.size)
            return self.K * np.array([[ratios[0]], [ratios[1]], [1.0]])
        scale = max(frames[0] / self.size[0], frames[1] / self.size[1])
        K = self.K * np.array([[scale], [scale], [1.0]])
        K[:2, 2] -= cut * {"cropped_end": 0.0, "cropped_start": 1.0, "cropped_middle": 0.5}[fit]
        return K
