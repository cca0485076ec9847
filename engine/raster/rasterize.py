"""`rasterize` and `tile_boxes`: Gaussians to pictures, and to the tiles they touch, by any back end.

Checks arguments and hands them on; computes nothing.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from engine.argument_checks import require_tensor
from engine.raster.gaussians import Gaussians
from engine.raster.pinhole_view import PinholeView, n_tiles, pinhole_views
from engine.raster.rasterizer import Rasterizer
from engine.raster.rendering import Rendering
from engine.raster.tile_boxes import TileBoxes


def rasterize(
    gaussians: Gaussians,
    viewmats: Tensor,
    Ks: Tensor,
    width: int,
    height: int,
    *,
    backend: Rasterizer,
    background: Tensor | None = None,
    near_plane: float = 0.01,
    tile_mask: Tensor | None = None,
    want_means2d: bool = False,
    want_depth: bool = False,
) -> Rendering:
    """Render Gaussians from C cameras.

    Differentiable in every Gaussian parameter and in the background, not in the cameras. Rows that cannot be drawn
    (NaN, infinite, a zero quaternion, behind the near plane, opacity below 1/255) are left out and get a zero
    gradient. Frozen rows (`Gaussians.is_frozen`) are drawn but get a zero gradient, and cost little of the backward
    pass. Safe to call from several threads at once.

    Args:
        gaussians: The Gaussians to draw; all five tensors share one floating dtype and one device.
        viewmats: World to camera, OpenCV axes. [C, 4, 4]
        Ks: Pinhole intrinsics for `width` x `height`, no skew. [C, 3, 3]
        width, height: Image size, pixels.
        backend: The backend that draws, from engine.backends.
        background: Colour behind everything; black if None. [3]
        near_plane: Centres at or before this depth are dropped, scene units.
        tile_mask: Tiles of TILE_PX x TILE_PX pixels that are wanted; None for all. Pixels of others hold the background
            and alpha 0, and pass no gradient to anything. [C, rows, columns] or, for all cameras, [rows, columns] bool
        want_means2d: Also return projected centres that receive a gradient, for densification.
        want_depth: Also return the accumulated depth.
    Returns:
        Rendering with image [C, H, W, 3] and alpha [C, H, W, 1].
    Raises:
        TypeError: A dtype or device that does not fit. Names the argument.
        ValueError: A shape or value that does not fit. Names the argument, and both shapes.
    """
    check_gaussians(gaussians)
    views = pinhole_views(viewmats, Ks, width, height, near_plane)
    means = gaussians.means
    if background is None:
        background = means.new_zeros(3)
    else:
        require_tensor("background", background)
        if background.shape != (3,):
            raise ValueError(f"background must be [3], got {list(background.shape)}")
        if not all(map(math.isfinite, background.tolist())):
            raise ValueError(f"background must be finite, got {background.tolist()}")
    return backend.rasterize(
        gaussians,
        views,
        background.to(means),
        tile_mask=None if tile_mask is None else _checked_mask(tile_mask, views, means.device),
        want_means2d=want_means2d,
        want_depth=want_depth,
    )


def tile_boxes(
    gaussians: Gaussians,
    viewmat: Tensor,
    K: Tensor,
    width: int,
    height: int,
    *,
    backend: Rasterizer,
    near_plane: float = 0.01,
) -> TileBoxes:
    """Tiles that Gaussians may touch in one picture, without drawing it. Arguments as in `rasterize`, of one camera.

    The boxes are those of the rasterizer, so a tile outside of one holds no trace of its Gaussian: not in the image and
    not in a gradient.

    Args:
        viewmat: [4, 4]
        K: [3, 3]
    Raises:
        TypeError, ValueError: An argument does not fit; the message names it.
    """
    check_gaussians(gaussians)
    for name, matrix in (("viewmat", viewmat), ("K", K)):
        require_tensor(name, matrix)
    (view,) = pinhole_views(viewmat[None], K[None], width, height, near_plane)
    return backend.tile_boxes(gaussians, view)


def _checked_mask(tile_mask: Tensor, views: list[PinholeView], device: torch.device) -> Tensor:
    """[C, rows, columns] bool"""
    require_tensor("tile_mask", tile_mask)
    n_views, width, height = len(views), views[0].width, views[0].height
    shape = n_tiles(width, height)
    if tile_mask.shape not in (shape, (n_views, *shape)):
        raise ValueError(
            f"tile_mask must be {[n_views, *shape]} or {list(shape)} for {n_views} images of {width} x {height}, "
            f"got {list(tile_mask.shape)}"
        )
    if tile_mask.dtype != torch.bool:
        raise TypeError(f"tile_mask must be bool, got {tile_mask.dtype}")
    return tile_mask.to(device).expand(n_views, *shape)


def check_gaussians(gaussians: Gaussians) -> None:
    """Shapes, dtypes and device fit each other. TypeError or ValueError that names the tensor."""
    means = gaussians.means
    require_tensor("means", means)
    if means.ndim != 2 or means.shape[1] != 3:
        raise ValueError(f"means must be [N, 3], got {list(means.shape)}")
    if not means.dtype.is_floating_point:
        raise TypeError(f"means must be floating point, got {means.dtype}")
    n_rows = len(means)
    wanted = {"quats": (n_rows, 4), "scales": (n_rows, 3), "opacities": (n_rows,), "colors": (n_rows, 3)}
    for name, shape in wanted.items():
        tensor = getattr(gaussians, name)
        require_tensor(name, tensor)
        if tensor.shape != shape:
            raise ValueError(
                f"{name} must be {list(shape)} to match means {list(means.shape)}, got {list(tensor.shape)}"
            )
        if tensor.dtype != means.dtype or tensor.device != means.device:
            raise TypeError(
                f"{name} must be {means.dtype} on {means.device} like means, got {tensor.dtype} on {tensor.device}"
            )
    is_frozen = gaussians.is_frozen
    if is_frozen is None:
        return
    require_tensor("is_frozen", is_frozen)
    if is_frozen.shape != (n_rows,):
        raise ValueError(
            f"is_frozen must be {[n_rows]} to match means {list(means.shape)}, got {list(is_frozen.shape)}"
        )
    if is_frozen.dtype != torch.bool or is_frozen.device != means.device:
        raise TypeError(f"is_frozen must be bool on {means.device}, got {is_frozen.dtype} on {is_frozen.device}")
