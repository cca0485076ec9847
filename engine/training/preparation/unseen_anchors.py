"""Static anchors that hardly any pixel shows look like those around them, once these have been trained.

What lies behind everything has gradients of next to nothing, and Adam makes steps of full length of them: after some
thousand steps such an anchor has any colour and opacity, and a view from elsewhere sees black holes and specks.
"""

from __future__ import annotations

import numpy as np
import torch
from scipy.spatial import KDTree
from torch import Tensor

from engine.cloud.motion.dedup import mean_neighbor_distance
from engine.model.clip_model import ClipModel
from engine.model.host_array import host_array

FAINT = 0.02
"""Share of the median root mean square gradient below which an anchor is not shown."""
N_NEIGHBORS = 12
"""Trained neighbours, of which the one with the most usual colour is the model."""
MIN_OPACITY = 0.5
"""Mean opacity of a model, where there is such a neighbour."""


def continue_unseen(model: ClipModel, role: str, squares: np.ndarray) -> int:
    """Give anchors without gradients the look of a trained neighbour, as large as the distance to their own neighbours.

    But no larger than they are or the neighbour is: one that stands alone would fill the space around it.

    Args:
        model: Its set is changed in place.
        role: Of a static set.
        squares: Adam's mean squares of the gradients of its features. [A, F]
    Returns:
        The number of anchors changed.
    """
    anchors = model.anchor_set(role)
    strength = np.sqrt(squares.mean(1, dtype=np.float64))
    is_shown = strength > FAINT * np.median(strength)
    if is_shown.all() or is_shown.sum() <= N_NEIGHBORS:
        return 0
    positions = host_array(anchors.positions).astype(np.float64)
    unseen, shown = np.flatnonzero(~is_shown), np.flatnonzero(is_shown)
    neighbors = shown[KDTree(positions[shown]).query(positions[unseen], N_NEIGHBORS)[1]]
    models = torch.from_numpy(_usual(model, role, neighbors))
    rows = torch.from_numpy(unseen)
    distances = mean_neighbor_distance(positions, k=3)
    distances = np.maximum(distances, 1e-6 * np.median(distances) + np.finfo(np.float32).tiny)  # points that coincide
    grown = torch.from_numpy(np.log(distances[unseen] / distances[models.numpy()])).to(anchors.features)[:, None]
    with torch.no_grad():
        anchors.features[rows] = anchors.features[models]
        for scales in (anchors.log_offset_scales, anchors.log_base_scales):
            scales[rows] = torch.minimum(scales[models] + grown, torch.maximum(scales[rows], scales[models]))
    return len(unseen)


def _usual(model: ClipModel, role: str, neighbors: np.ndarray) -> np.ndarray:
    """Of each row of neighbours, the opaque one whose colour is nearest to their median. [U, N] to [U] int64"""
    gaussians, k = model.static_gaussians(role), model.decoder.gaussians_per_anchor

    def per_anchor(values: Tensor) -> np.ndarray:
        return host_array(values).reshape(len(values) // k, k, -1).mean(1)

    colors, opacities = per_anchor(gaussians.colors)[neighbors], per_anchor(gaussians.opacities)[neighbors][..., 0]
    away = np.abs(colors - np.median(colors, axis=1, keepdims=True)).sum(-1)
    away[opacities < MIN_OPACITY] += 10.0  # behind every opaque one
    return neighbors[np.arange(len(neighbors)), away.argmin(1)]
