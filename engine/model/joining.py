"""Frozen Gaussians in front of learning ones: one set for the rasterizer; gradients go to the learning part alone.

The frozen part is chosen Gaussian by Gaussian, finer than the anchors of `decode_anchors`.
"""

from __future__ import annotations

import torch
from torch import Tensor

from engine.argument_checks import require_tensor
from engine.model.model_backend import ModelBackend
from engine.raster.gaussians import Gaussians


def join_frozen(frozen: Gaussians, rows: Tensor, learning: Gaussians, *, backend: ModelBackend) -> Gaussians:
    """Chosen rows of frozen Gaussians, then others; differentiable in the others alone.

    Args:
        frozen: Any number.
        rows: Rows of `frozen`. [n] int64
        learning: Not frozen, or frozen in part.
        backend: The backend that joins, from engine.backends.
    Raises:
        ValueError: A row is out of range.
        TypeError: Rows are not int64 [n], or a column is not of the dtype and on the device that the back end needs.
    """
    require_tensor("rows", rows)
    if rows.dtype != torch.int64 or rows.ndim != 1:
        raise TypeError(f"rows must be int64 [n], got {rows.dtype} {list(rows.shape)}")
    if rows.device.type == "cpu" and len(rows):  # elsewhere a check would wait for the device, which has its own
        values = rows.numpy()  # numpy takes a tenth of torch's time to check a few thousand numbers
        if not 0 <= values.min() <= values.max() < len(frozen):
            raise ValueError(f"rows must lie in 0..{len(frozen) - 1}, got {values.min()}..{values.max()}")
    return backend.join(frozen, rows, learning)
