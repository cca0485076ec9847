"""Measures of anchors from the pixels before them: maps of one camera spread over the anchors that they show.

A pixel is the sum over Gaussians of weight times colour, so the derivative of (pixels times map) by a Gaussian's colour
is the sum over pixels of map times weight: one backward pass of the rasterizer shares maps out by exactly the weights
with which the picture was blended, hidden Gaussians included with the little that shows of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch

from engine.camera.rig import CameraRig
from engine.metrics.clips.trained_clip import TrainedClip
from engine.model.clip_view import render_gaussians, visible_rows
from engine.model.host_array import host_array

N_MAPS = 2
"""Maps that are spread at a time; the third colour counts the weights themselves."""


@dataclass(frozen=True, slots=True)
class AnchorShares:
    """Sums over pixels for every anchor of a clip, roles in the order of the model.

    Attributes:
        sums: Of map times weight. [A, N_MAPS] float64
        weights: Of the weights: how many pixels an anchor covers. [A] float64
    """

    sums: np.ndarray
    weights: np.ndarray

    def __add__(self, other: AnchorShares) -> AnchorShares:
        return AnchorShares(self.sums + other.sums, self.weights + other.weights)


def anchor_shares(
    trained: TrainedClip,
    rig: CameraRig,
    camera: int,
    clip_time: float,
    maps: np.ndarray,
    is_valid: np.ndarray | None = None,
) -> AnchorShares:
    """Spread the maps of one picture over the anchors in it.

    Args:
        maps: Of the picture that the camera has of the clip at this time. [H, W, N_MAPS] float32
        is_valid: Pixels that the camera sees, None for all; the others count for no anchor. [H, W] bool
    """
    model, view = trained.model, trained.view(rig, camera)
    height, width = maps.shape[:2]
    with torch.no_grad():
        rows = visible_rows(model, view, clip_time, reach=trained.reach)
        decoded = model.decode(clip_time, rows)
    colors = decoded.colors.detach().clone().requires_grad_()
    with torch.enable_grad():
        image = render_gaussians(replace(decoded, colors=colors, is_frozen=None), view, backend=model.backend).image[0]
        gradient = np.ones((height, width, 3), np.float32)
        gradient[..., :N_MAPS] = maps
        if is_valid is not None:
            gradient[~is_valid] = 0.0
        image.backward(torch.from_numpy(gradient).to(image))
    assert colors.grad is not None
    per_anchor = host_array(colors.grad).astype(np.float64).reshape(-1, model.decoder.gaussians_per_anchor, 3).sum(1)
    everywhere = np.concatenate(
        [first + host_array(rows[role]) for role, first in zip(model.roles(), _first_rows(trained), strict=True)]
    )
    found = np.zeros((sum(len(model.anchor_set(role)) for role in model.roles()), 3))
    found[everywhere] = per_anchor
    return AnchorShares(found[:, :N_MAPS], found[:, N_MAPS])


def anchors_at(trained: TrainedClip, clip_time: float) -> tuple[np.ndarray, np.ndarray]:
    """Anchors that exist at a time: their rows in AnchorShares [n] int64 and positions [n, 3] float32."""
    rows, positions = [np.zeros(0, np.int64)], [np.zeros((0, 3), np.float32)]
    for role, first in zip(trained.model.roles(), _first_rows(trained), strict=True):
        alive = host_array(trained.model.alive(role, clip_time))
        rows.append(first + alive)
        positions.append(host_array(trained.model.positions(role, clip_time))[alive].astype(np.float32))
    return np.concatenate(rows), np.concatenate(positions)


def _first_rows(trained: TrainedClip) -> list[int]:
    """Where the anchors of each role begin."""
    sizes = [len(trained.model.anchor_set(role)) for role in trained.model.roles()]
    return [sum(sizes[:index]) for index in range(len(sizes))]
