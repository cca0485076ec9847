"""Overdraw: how many Gaussians blend in each pixel, by the rules of the rasterizer. One compiled kernel."""

from __future__ import annotations

import numpy as np
import torch
from numba import njit

from engine.backends.reference.raster import drawable_rows, pixel_boxes, project
from engine.conventions import ALPHA_MAX, ALPHA_MIN, TRANSMITTANCE_MIN
from engine.raster.gaussians import Gaussians
from engine.raster.pinhole_view import PinholeView

_ALPHA_MIN, _ALPHA_MAX, _OPEN = np.float32(ALPHA_MIN), np.float32(ALPHA_MAX), np.float32(TRANSMITTANCE_MIN)


@torch.no_grad()
def overdraw(gaussians: Gaussians, view: PinholeView) -> np.ndarray:
    """How many Gaussians blend in each pixel: alpha reaches ALPHA_MIN there, and the pixel is not finished before.

    Rows that cannot be drawn count nowhere.

    Args:
        gaussians: float32, in main memory.
    Returns:
        [H, W] int32
    """
    counts = np.zeros((view.height, view.width), np.int32)
    rows = drawable_rows(gaussians, view)
    if len(rows) == 0:
        return counts
    drawn = gaussians[rows]
    centers, covariances, _ = project(drawn, view)
    first, last, _ = pixel_boxes(centers, covariances, drawn.opacities, view)
    shapes = torch.linalg.inv(covariances)
    footprints = torch.stack([shapes[:, 0, 0], shapes[:, 0, 1], shapes[:, 1, 1], drawn.opacities], -1)
    boxes = torch.cat([first, last], -1).int()
    arrays = [np.ascontiguousarray(tensor.numpy()) for tensor in (centers, footprints, boxes)]
    _count(arrays[0], arrays[1], arrays[2], np.ones(counts.shape, np.float32), counts)
    return counts


@njit(cache=True, nogil=True, error_model="numpy")
def _count(centers, footprints, boxes, transmittance, counts):
    for i in range(len(centers)):
        u, v = centers[i, 0], centers[i, 1]
        xx, xy, yy, opacity = footprints[i, 0], footprints[i, 1], footprints[i, 2], footprints[i, 3]
        for y in range(boxes[i, 1], boxes[i, 3] + 1):
            dy = np.float32(y) + np.float32(0.5) - v
            for x in range(boxes[i, 0], boxes[i, 2] + 1):
                if transmittance[y, x] < _OPEN:
                    continue
                dx = np.float32(x) + np.float32(0.5) - u
                power = np.float32(0.5) * (xx * dx * dx + yy * dy * dy) + xy * dx * dy
                alpha = opacity * np.exp(-power)
                if alpha >= _ALPHA_MIN:
                    counts[y, x] += 1
                    transmittance[y, x] *= np.float32(1.0) - min(alpha, _ALPHA_MAX)
