"""tOF: how far the motion in a render is from the motion in the truth, between two neighbouring frames of one camera.

The mean over pixels of |flow of the render - flow of the truth|, in pixels per frame; lower is better. Flows are those
of 8-bit grey pictures by Farneback's method with the usual parameters, and a border is left out: the largest middle
part counts whose sides are multiples of 32 px and at least 16 px shorter than the picture's. Source: TecoGAN (Chu et
al. 2020), in the form of its published code, which printed tOF figures come from.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from engine.metrics.pictures.colors import to_levels
from engine.metrics.pictures.optical_flow import Expansion, expansion_of, flow_between

BLOCK_PX, MARGIN_PX = 32, 16
"""Sides of what counts are multiples of the first, and shorter than the picture by at least the second."""
MIN_SIDE_PX = BLOCK_PX + MARGIN_PX
"""Pictures with a shorter side have no tOF."""
_GREY = np.array([0.299, 0.587, 0.114], np.float32)


class Motion(NamedTuple):
    """One frame of one camera, made ready to be compared with its neighbours: render and truth."""

    render: Expansion
    truth: Expansion


def motion_of(image: np.ndarray, pixels: np.ndarray) -> Motion | None:
    """One frame; None where pictures are too small to have a tOF.

    Args:
        image: The render, in 0..1 and finite; rounded to 8 bit. [H, W, 3]
        pixels: What the camera took. [H, W, 3] uint8
    """
    if min(image.shape[:2]) < MIN_SIDE_PX:
        return None
    return Motion(*(expansion_of(grey_levels(levels)) for levels in (to_levels(image), pixels)))


def tof(before: Motion, after: Motion, is_valid: np.ndarray | None = None) -> float | None:
    """tOF of two neighbouring frames, px per frame; None where no pixel counts.

    Args:
        before, after: The earlier and the later frame.
        is_valid: What the camera sees; None for all. [H, W] bool
    """
    flow, truth = flow_between(before.render, after.render), flow_between(before.truth, after.truth)
    errors = np.linalg.norm(flow - truth, axis=-1)
    rows, columns = (_middle(length) for length in errors.shape)
    counted = errors[rows, columns]
    if is_valid is not None:
        counted = counted[is_valid[rows, columns]]
    mean = float(counted.mean(dtype=np.float64)) if counted.size else np.nan
    return mean if np.isfinite(mean) else None


def grey_levels(levels: np.ndarray) -> np.ndarray:
    """Brightness of 8-bit colours, rounded to whole levels. [H, W, 3] uint8 to [H, W] float32"""
    return np.floor(levels.astype(np.float32) @ _GREY + np.float32(0.5))


def _middle(length: int) -> slice:
    n = (length - MARGIN_PX) // BLOCK_PX * BLOCK_PX
    start = (length - n) // 2
    return slice(start, start + n)
