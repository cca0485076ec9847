"""Static anchors that hardly any pixel shows look like those around them, once these have been trained.

What lies behind everything has gradients of next to nothing, and Adam makes steps of full length of them: after some
thousand steps such an anchor has any colour and opacity, and a view from elsewhere sees black holes and specks. Where
cameras look through an anchor, it has learned to be clear, and stays so.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from scipy.spatial import KDTree
from torch import Tensor

from engine.camera.projection import is_in_picture, project
from engine.cloud.motion.dedup import mean_neighbor_distance
from engine.cloud.stereo.depth.consistency import SEE_THROUGH_SHARE
from engine.model.clip_model import ClipModel
from engine.model.clip_view import View
from engine.model.host_array import host_array
from engine.raster import rasterize

FAINT = 0.02
"""Share of the median root mean square gradient below which an anchor is not shown."""
N_NEIGHBORS = 12
"""Trained neighbours, of which the one with the most usual colour is the model."""
MIN_OPACITY = 0.5
"""Mean opacity of a model, where there is such a neighbour."""


def continue_unseen(model: ClipModel, role: str, squares: np.ndarray, views: Sequence[View]) -> int:
    """Give anchors without gradients the look of a trained neighbour, as large as the distance to their own neighbours,
    but no larger than they are or the neighbour is.

    Args:
        model: Its set is changed in place.
        role: Of a static set.
        squares: Adam's mean squares of the gradients of its features. [A, F]
        views: Of the training cameras.
    Returns:
        The number of anchors changed.
    """
    anchors = model.anchor_set(role)
    strength = np.sqrt(squares.mean(1, dtype=np.float64))
    is_shown = strength > FAINT * np.median(strength)
    if is_shown.all() or is_shown.sum() <= N_NEIGHBORS:
        return 0
    positions = host_array(anchors.positions).astype(np.float64)
    is_unseen = ~is_shown & ~_is_looked_through(model, role, positions, views)
    if not is_unseen.any():
        return 0
    unseen, shown = np.flatnonzero(is_unseen), np.flatnonzero(is_shown)
    neighbors = shown[KDTree(positions[shown]).query(positions[unseen], N_NEIGHBORS)[1]]
    models = torch.from_numpy(_usual(model, role, neighbors))
    rows = torch.from_numpy(unseen)
    distances = mean_neighbor_distance(positions, k=3)
    grown = torch.from_numpy(np.log(distances[unseen] / distances[models.numpy()])).to(anchors.features)[:, None]
    with torch.no_grad():
        anchors.features[rows] = anchors.features[models]
        for scales in (anchors.log_offset_scales, anchors.log_base_scales):
            scales[rows] = torch.minimum(scales[models] + grown, torch.maximum(scales[rows], scales[models]))
    return len(unseen)


def _is_looked_through(model: ClipModel, role: str, positions: np.ndarray, views: Sequence[View]) -> np.ndarray:
    """Whether a camera sees something behind an anchor. [A] bool"""
    gaussians, is_through = model.static_gaussians(role), np.zeros(len(positions), bool)
    for view in views:
        pose, K = view.world_to_camera[None], view.K[None]
        with torch.no_grad():
            seen = rasterize(
                gaussians,
                pose,
                K,
                view.width,
                view.height,
                backend=model.backend,
                near_plane=view.near_plane,
                want_depth=True,
            )
        assert seen.expected_depth is not None
        depths = host_array(seen.expected_depth)[0, ..., 0]
        matrix = host_array(K)[0].astype(np.float64) @ host_array(pose)[0, :3].astype(np.float64)
        pixels, own = project(positions, matrix)
        rows = np.flatnonzero(is_in_picture(pixels, own, view.width, view.height))
        x, y = pixels[rows].astype(int).T
        is_through[rows] |= depths[y, x] > (1 + SEE_THROUGH_SHARE) * own[rows]
    return is_through


def _usual(model: ClipModel, role: str, neighbors: np.ndarray) -> np.ndarray:
    """Of each row of neighbours, the opaque one whose colour is nearest to their median. [U, N] to [U] int64"""
    gaussians, k = model.static_gaussians(role), model.decoder.gaussians_per_anchor

    def per_anchor(values: Tensor) -> np.ndarray:
        return host_array(values).reshape(len(values) // k, k, -1).mean(1)

    colors, opacities = per_anchor(gaussians.colors)[neighbors], per_anchor(gaussians.opacities)[neighbors][..., 0]
    away = np.abs(colors - np.median(colors, axis=1, keepdims=True)).sum(-1)
    away[opacities < MIN_OPACITY] += 10.0  # behind every opaque one
    return neighbors[np.arange(len(neighbors)), away.argmin(1)]
