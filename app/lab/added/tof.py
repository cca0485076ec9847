"""tOF: how far the motion in a render is from the motion in the truth, between two neighbouring frames of one camera.

The mean over pixels of |flow of the render - flow of the truth|, in pixels per frame; lower is better. Flows are those
of 8-bit grey pictures by OpenCV's Farneback method with the usual parameters, and a border is left out: the largest
middle part counts whose sides are multiples of 32 px and at least 16 px shorter than the picture's. Source: TecoGAN
(Chu et al. 2020), in the form of its published code, which printed tOF figures come from.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from engine.metrics.pictures.colors import to_levels

BLOCK_PX, MARGIN_PX = 32, 16
"""Sides of the part that counts are multiples of the first, and shorter than the picture's by at least the second."""
MIN_SIDE_PX = BLOCK_PX + MARGIN_PX
"""Pictures with a shorter side have no tOF."""
PYRAMID_SCALE, N_LEVELS, WINDOW_PX, N_ITERATIONS, RADIUS_PX, SIGMA_PX = 0.5, 3, 15, 3, 5, 1.2
_GREY = np.array([0.299, 0.587, 0.114], np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """One frame of one camera, to be compared with its neighbours: grey levels of render and truth. [H, W] uint8

    Attributes:
        is_valid: Pixels that the camera sees; None for all. [H, W] bool
    """

    render: np.ndarray
    truth: np.ndarray
    is_valid: np.ndarray | None = None


def motion_of(image: np.ndarray, pixels: np.ndarray, is_valid: np.ndarray | None = None) -> Motion | None:
    """One frame; None where a picture is too small, or not finite, to have a tOF.

    Args:
        image: The render, in 0..1; rounded to 8 bit. [H, W, 3]
        pixels: The camera's picture. [H, W, 3] uint8
        is_valid: See Motion.
    """
    if min(image.shape[:2]) < MIN_SIDE_PX or not np.isfinite(image).all():
        return None
    return Motion(grey_levels(to_levels(image)), grey_levels(pixels), is_valid)


def tof(before: Motion, after: Motion) -> float | None:
    """tOF of two neighbouring frames, px per frame; None where no pixel counts."""
    flow, truth = optical_flow(before.render, after.render), optical_flow(before.truth, after.truth)
    errors = np.linalg.norm(flow - truth, axis=-1)
    is_counted = np.zeros(errors.shape, bool)
    is_counted[tuple(_middle(length) for length in errors.shape)] = True
    for valid in (before.is_valid, after.is_valid):
        is_counted &= True if valid is None else valid
    mean = float(errors[is_counted].mean(dtype=np.float64)) if is_counted.any() else np.nan
    return mean if np.isfinite(mean) else None


def optical_flow(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Motion of each pixel's content to the right and down until the later picture, px. [H, W, 2] float32

    Args:
        before, after: Grey levels. [H, W] uint8
    """
    flow: Any = None  # made by the function
    return cv2.calcOpticalFlowFarneback(
        before,
        after,
        flow,
        PYRAMID_SCALE,
        N_LEVELS,
        WINDOW_PX,
        N_ITERATIONS,
        RADIUS_PX,
        SIGMA_PX,
        0,
    )


def grey_levels(levels: np.ndarray) -> np.ndarray:
    """Brightness of 8-bit colours, rounded to whole levels. [H, W, 3] uint8 to [H, W] uint8"""
    return np.floor(levels.astype(np.float32) @ _GREY + np.float32(0.5)).astype(np.uint8)


def _middle(length: int) -> slice:
    n = (length - MARGIN_PX) // BLOCK_PX * BLOCK_PX
    start = (length - n) // 2
    return slice(start, start + n)
