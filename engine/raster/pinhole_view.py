"""PinholeView: one camera as the back ends see it, checked once. Plain numbers; no torch below this line.

Not a camera of a capture (that is `engine.camera.rig`): it has no name, no lens and no file.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from engine.argument_checks import require_count, require_number, require_tensor
from engine.conventions import FRUSTUM_MARGIN

TILE_PX = 32
"""Edge of a tile, pixels: what `tile_mask` of `rasterize` counts in. Tiles at the right and lower border may be cut."""
_FLAT = 1e-9
"""A matrix whose determinant is below this share of what its size allows turns space into less than space."""
_BOTTOM_ERROR = 1e-6
"""The error that products and inverses in float32 may leave in the bottom row of a pose."""


def n_tiles(width: int, height: int) -> tuple[int, int]:
    """Rows and columns of tiles of an image."""
    return -(-height // TILE_PX), -(-width // TILE_PX)


@dataclass(frozen=True, slots=True)
class PinholeView:
    """One pinhole camera with an image size and a near plane.

    Attributes:
        rotation: World to camera. [3, 3] float64
        translation: World to camera, scene units. [3] float64
        fx, fy, cx, cy: Pixels, of an image of `width` x `height`.
        near_plane: Gaussians whose centre is not farther than this are dropped, scene units.
    """

    rotation: np.ndarray
    translation: np.ndarray
    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int
    near_plane: float

    def slope_limits(self) -> tuple[float, float, float, float]:
        """Smallest and largest x/z, then y/z, at which the projection is linearised (3DGS, `computeCov2D`).

        Beyond the image border the first-order footprint of a Gaussian grows without bound, so the slope is held at
        FRUSTUM_MARGIN of the image outside. Measured from the border and not from the axis, hence right for any
        principal point.
        """
        margin_x = FRUSTUM_MARGIN * self.width
        margin_y = FRUSTUM_MARGIN * self.height
        return (
            -(self.cx + margin_x) / self.fx,
            (self.width - self.cx + margin_x) / self.fx,
            -(self.cy + margin_y) / self.fy,
            (self.height - self.cy + margin_y) / self.fy,
        )


def pinhole_views(viewmats: Tensor, Ks: Tensor, width: int, height: int, near_plane: float) -> list[PinholeView]:
    """One PinholeView per row of `viewmats` [C, 4, 4] and `Ks` [C, 3, 3].

    Raises:
        TypeError: No tensor, or one without numbers (device meta); a size that is not a whole number.
        ValueError: A wrong shape, a number that is not finite, a pose with another bottom row than 0 0 0 1 or without
            an inverse, a focal length <= 0, skew, an empty image or a near plane <= 0. The message names the argument.
    """
    require_tensor("viewmats", viewmats)
    require_tensor("Ks", Ks)
    if viewmats.ndim != 3 or viewmats.shape[1:] != (4, 4) or not len(viewmats):
        raise ValueError(f"viewmats must be [C, 4, 4] with at least one camera, got {list(viewmats.shape)}")
    if Ks.shape != (len(viewmats), 3, 3):
        wanted = [len(viewmats), 3, 3]
        raise ValueError(f"Ks must be {wanted} to match viewmats {list(viewmats.shape)}, got {list(Ks.shape)}")
    require_count("width", width)
    require_count("height", height)
    require_number("near_plane", near_plane)
    if width < 1 or height < 1:
        raise ValueError(f"width and height must be at least 1, got {width} x {height}")
    if width >= 1 << 15 or height >= 1 << 15:
        raise ValueError(f"width and height must be below 32768, got {width} x {height}")
    if not 0.0 < near_plane < float("inf"):
        raise ValueError(f"near_plane must be a finite number > 0, got {near_plane}")
    poses = viewmats.detach().to("cpu", torch.float64).numpy()
    intrinsics = Ks.detach().to("cpu", torch.float64).numpy()
    for name, matrices in (("viewmats", poses), ("Ks", intrinsics)):
        finite = np.isfinite(matrices).all(axis=(1, 2))
        if not finite.all():
            row = int(np.argmin(finite))
            raise ValueError(f"{name}[{row}] holds numbers that are not finite:\n{matrices[row]}")
    views = []
    for row, (pose, K) in enumerate(zip(poses, intrinsics, strict=True)):
        if not _is_pose(pose.tolist()):
            raise ValueError(
                f"viewmats[{row}] must be a rotation and a translation over a bottom row 0 0 0 1, got\n{pose}"
            )
        if K[0, 0] <= 0.0 or K[1, 1] <= 0.0:
            raise ValueError(f"Ks[{row}] needs focal lengths > 0, got fx {K[0, 0]:g}, fy {K[1, 1]:g}")
        if K[0, 1] != 0.0 or K[1, 0] != 0.0:
            raise ValueError(f"Ks[{row}] has skew {K[0, 1]:g}, {K[1, 0]:g}; only skew-free cameras are supported")
        views.append(
            PinholeView(
                rotation=pose[:3, :3].copy(),
                translation=pose[:3, 3].copy(),
                fx=float(K[0, 0]),
                fy=float(K[1, 1]),
                cx=float(K[0, 2]),
                cy=float(K[1, 2]),
                width=int(width),
                height=int(height),
                near_plane=float(near_plane),
            )
        )
    return views


def _is_pose(rows: list[list[float]]) -> bool:
    """Whether the bottom row is 0 0 0 1 and the rest has an inverse. Plain floats: numpy takes ten times as long."""
    (a, b, c, _), (d, e, f, _), (g, h, i, _), bottom = rows
    if max(abs(found - wanted) for found, wanted in zip(bottom, (0.0, 0.0, 0.0, 1.0), strict=True)) > _BOTTOM_ERROR:
        return False
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    size = max(map(abs, (a, b, c, d, e, f, g, h, i)))
    return abs(determinant) > _FLAT * size**3
