"""Seeing a ClipModel through a camera: which anchors to decode, and the rendered picture.

Decoding anchors that no pixel can see is most of the work of a naive step, so anchors are culled before decoding. The
test is conservative: an anchor's Gaussians may sit a few spacings away from it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from engine.model.anchors import AnchorSet
from engine.model.clip_model import ClipModel
from engine.raster import Rendering, rasterize
from engine.raster.gaussians import Gaussians
from engine.raster.rasterizer import Rasterizer

REACH_SPACINGS = 4.0
"""Gaussians are expected within this many spacings, or sizes where those are larger, of their anchor."""


@dataclass(frozen=True, slots=True)
class View:
    """A pinhole camera at a picture size.

    Attributes:
        world_to_camera: Rigid map, OpenCV axes. [4, 4] float32
        K: Intrinsics in pixels at this size, pixel centres at +0.5. [3, 3] float32
        width, height: Pixels.
        near_plane: Nearest depth that is drawn, scene units.
    """

    world_to_camera: Tensor
    K: Tensor
    width: int
    height: int
    near_plane: float

    @classmethod
    def from_arrays(
        cls,
        world_to_camera: np.ndarray,
        K: np.ndarray,
        *,
        width: int,
        height: int,
        near_plane: float,
    ) -> View:
        """From numpy arrays of any float type."""
        to_tensor = torch.from_numpy
        return cls(
            to_tensor(np.ascontiguousarray(world_to_camera, np.float32)),
            to_tensor(np.ascontiguousarray(K, np.float32)),
            int(width),
            int(height),
            float(near_plane),
        )

    def part(self, x: int, y: int, width: int, height: int) -> View:
        """The view of a rectangle of the picture, pixels."""
        K = self.K.clone()
        K[0, 2] -= x
        K[1, 2] -= y
        return replace(self, K=K, width=width, height=height)

    def sees(self, positions: Tensor, *, reach: float | Tensor) -> Tensor:
        """Whether something within `reach` scene units, one or [A], of each position may touch a pixel. [A] bool"""
        world_to_camera, K = self.world_to_camera.to(positions), self.K.to(positions)
        p_camera = positions @ world_to_camera[:3, :3].T + world_to_camera[:3, 3]
        x, y, z = p_camera.unbind(1)
        depth = z.clamp_min(self.near_plane)
        fx, fy, cx, cy = K[0, 0], K[1, 1], K[0, 2], K[1, 2]
        u, v = fx * x / depth + cx, fy * y / depth + cy
        reach_x, reach_y = (
            fx * reach / depth + 2.0,
            fy * reach / depth + 2.0,
        )  # +2 px for the low-pass filter
        is_inside = (u > -reach_x) & (u < self.width + reach_x) & (v > -reach_y) & (v < self.height + reach_y)
        return is_inside & (z > self.near_plane - reach)


def reaches_of(anchors: AnchorSet, reach: float) -> Tensor:
    """How far from its anchor each one's Gaussians are expected, scene units: those of a backdrop are large. [A]

    Args:
        reach: Of anchors whose size is a spacing.
    """
    return (REACH_SPACINGS * anchors.log_offset_scales.detach().amax(1).exp()).clamp_min(reach)


def visible_rows(model: ClipModel, view: View, clip_time: float, *, reach: float) -> dict[str, Tensor]:
    """Rows per role that exist at this time and that the view may see."""
    rows = {}
    for role in model.roles():
        alive = model.alive(role, clip_time)
        anchors = model.anchor_set(role)
        positions = model.positions(role, clip_time).detach()[alive]
        rows[role] = alive[view.sees(positions, reach=reaches_of(anchors, reach)[alive])]
    return rows


def render_gaussians(
    gaussians: Gaussians,
    view: View,
    *,
    backend: Rasterizer,
    background: Tensor | None = None,
    tile_mask: Tensor | None = None,
) -> Rendering:
    """Rasterize through one view; tensors of the rendering have a leading camera axis of 1.

    Args:
        backend: The backend that draws.
        tile_mask: Tiles that are wanted, None for all. [rows, columns] bool
    """
    return rasterize(
        gaussians,
        view.world_to_camera[None],
        view.K[None],
        view.width,
        view.height,
        backend=backend,
        background=background,
        near_plane=view.near_plane,
        tile_mask=tile_mask,
    )


def render_model(model: ClipModel, view: View, clip_time: float, *, reach: float) -> Tensor:
    """Picture of a clip at a time, scene colours over black, without gradient. [H, W, 3]"""
    with torch.no_grad():
        rows = visible_rows(model, view, clip_time, reach=reach)
        return render_gaussians(model.decode(clip_time, rows), view, backend=model.backend).image[0]
