"""The slow truth: every Gaussian against every pixel in plain torch, gradients by autograd.

Works in any floating dtype and on any device; in float64 it is what the fast back ends are tested against. It holds
no acceleration beyond cutting the image into strips of rows that are recomputed in the backward pass, so that memory
stays bounded. Image formation: Zwicker et al. 2001 (EWA splatting) as used by Kerbl et al. 2023 (3D Gaussian
Splatting), with the constants of `engine.conventions`.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor
from torch.utils.checkpoint import checkpoint

from engine.conventions import ALPHA_MAX, ALPHA_MIN, EPS2D_PX2, TRANSMITTANCE_MIN
from engine.raster.gaussians import Gaussians
from engine.raster.limits import EXTENT_MAX_PX, QUAT_NORM_SQUARED_MAX, QUAT_NORM_SQUARED_MIN, VALUE_MAX
from engine.raster.pinhole_view import TILE_PX, PinholeView
from engine.raster.rendering import Rendering

_PAIRS_PER_STRIP = 1 << 22
"""Gaussian-pixel pairs evaluated at once: 32 MiB per float64 intermediate."""


def rasterize_reference(
    gaussians: Gaussians,
    views: list[PinholeView],
    background: Tensor,
    *,
    tile_mask: Tensor | None,
    want_means2d: bool,
    want_depth: bool,
) -> Rendering:
    """Render every view by brute force. Arguments are those of `rasterize`, already checked."""
    gaussians = _without_frozen_history(gaussians)
    images, alphas, depth_images = [], [], []
    means2d = gaussians.means.new_zeros(len(views), len(gaussians), 2) if want_means2d else None
    rows_per_view = [drawable_rows(gaussians.detach(), view) for view in views]
    if means2d is not None:
        for camera, (view, rows) in enumerate(zip(views, rows_per_view, strict=True)):
            means2d[camera, rows] = project(gaussians.detach()[rows], view)[0]
        means2d.requires_grad_(torch.is_grad_enabled())
    for camera, (view, rows) in enumerate(zip(views, rows_per_view, strict=True)):
        drawn = gaussians[rows]
        centers, covariances, depths = project(drawn, view)
        if means2d is not None:  # zero in value; routes the gradient of the centres into the leaf as well
            leaf = means2d[camera, rows]
            if drawn.is_frozen is not None:
                leaf = torch.where(drawn.is_frozen[:, None], leaf.detach(), leaf)
            centers = centers + (leaf - leaf.detach())
        channels = torch.cat([drawn.colors, depths[:, None]], -1) if want_depth else drawn.colors
        image, transmittance = _blend(centers, covariances, drawn.opacities, channels, view)
        if tile_mask is not None:
            is_wanted = _pixels_of_tiles(tile_mask[camera], view).to(image.device)
            image = torch.where(is_wanted, image, 0.0)
            transmittance = torch.where(is_wanted, transmittance, 1.0)
            background_here = torch.where(is_wanted, background, background.detach())
        else:
            background_here = background
        images.append(image[..., :3] + transmittance * background_here)
        alphas.append(1.0 - transmittance)
        depth_images.append(image[..., 3:])
    depth = torch.stack(depth_images) if want_depth else None
    return Rendering(torch.stack(images), torch.stack(alphas), means2d, depth)


def _pixels_of_tiles(tile_mask: Tensor, view: PinholeView) -> Tensor:
    """A mask of tiles as one of pixels. [rows, columns] -> [H, W, 1]"""
    pixels = tile_mask.repeat_interleave(TILE_PX, 0).repeat_interleave(TILE_PX, 1)
    return pixels[: view.height, : view.width, None]


def _without_frozen_history(gaussians: Gaussians) -> Gaussians:
    """The same values; nothing flows back to frozen rows."""
    is_frozen = gaussians.is_frozen
    if is_frozen is None:
        return gaussians
    cut = (
        torch.where(is_frozen.view(-1, *[1] * (tensor.ndim - 1)), tensor.detach(), tensor)
        for tensor in gaussians.tensors()
    )
    return Gaussians(*cut, is_frozen=is_frozen)


def project(gaussians: Gaussians, view: PinholeView) -> tuple[Tensor, Tensor, Tensor]:
    """Centres [N, 2] px, covariances [N, 2, 2] px^2 with the low-pass added, and camera depths [N]."""
    means = gaussians.means
    rotation = torch.from_numpy(view.rotation).to(means)
    means_camera = means @ rotation.T + torch.from_numpy(view.translation).to(means)
    x, y, z = means_camera.unbind(-1)
    slope_x_min, slope_x_max, slope_y_min, slope_y_max = view.slope_limits()
    slope_x = (x / z).clamp(slope_x_min, slope_x_max)
    slope_y = (y / z).clamp(slope_y_min, slope_y_max)
    zero = torch.zeros_like(z)
    jacobian_x = torch.stack([view.fx / z, zero, -view.fx * slope_x / z], -1)
    jacobian_y = torch.stack([zero, view.fy / z, -view.fy * slope_y / z], -1)
    jacobian = torch.stack([jacobian_x, jacobian_y], -2)  # [N, 2, 3]
    axes = rotation_matrices(gaussians.quats) * gaussians.scales[:, None, :]
    half = jacobian @ rotation @ axes  # [N, 2, 3], covariance = half half^T
    covariances = half @ half.transpose(1, 2) + EPS2D_PX2 * torch.eye(2).to(means)
    centers = torch.stack([view.fx * x / z + view.cx, view.fy * y / z + view.cy], -1)
    return centers, covariances, z


def rotation_matrices(quats: Tensor) -> Tensor:
    """Rotation matrices of wxyz quaternions of any length above zero. [N, 4] -> [N, 3, 3]"""
    w, x, y, z = (quats / quats.norm(dim=-1, keepdim=True)).unbind(-1)
    rows = (
        torch.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], -1),
        torch.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], -1),
        torch.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], -1),
    )
    return torch.stack(rows, -2)


@torch.no_grad()
def drawable_rows(gaussians: Gaussians, view: PinholeView) -> Tensor:
    """Indices of the Gaussians that can be drawn, nearest first; equal float32 depths keep their order. [R] int64

    Called before anything is recorded for autograd, so that a row with NaN never enters the graph.
    """
    centers, covariances, depths = project(gaussians, view)
    norms_squared = gaussians.quats.square().sum(-1)
    opacities = gaussians.opacities
    first_pixels, last_pixels, half_extents = pixel_boxes(centers, covariances, opacities, view)
    keep = (
        (depths > view.near_plane)
        & (depths < VALUE_MAX)
        & (opacities > ALPHA_MIN)
        & (opacities < VALUE_MAX)
        & (norms_squared > QUAT_NORM_SQUARED_MIN)
        & (norms_squared < QUAT_NORM_SQUARED_MAX)
        & (half_extents < EXTENT_MAX_PX).all(-1)
        & (centers.abs() < VALUE_MAX).all(-1)
        & (gaussians.colors.abs() < VALUE_MAX).all(-1)
    )
    keep &= (first_pixels <= last_pixels).all(-1)
    rows = torch.nonzero(keep)[:, 0]
    return rows[torch.argsort(depths[rows].float(), stable=True)]


def pixel_boxes(
    centers: Tensor, covariances: Tensor, opacities: Tensor, view: PinholeView
) -> tuple[Tensor, Tensor, Tensor]:
    """First and last pixel (x, y) whose centre lies in the bounding box, cut to the image, and half extents. [N, 2]"""
    # where alpha falls to ALPHA_MIN; NaN below that opacity
    half_extents = torch.sqrt(2 * torch.log(opacities / ALPHA_MIN)[:, None] * covariances.diagonal(dim1=-2, dim2=-1))
    size = torch.tensor([view.width, view.height]).to(centers)
    first = torch.ceil(centers - half_extents - 0.5).clamp_min(0)
    return first, torch.minimum(torch.floor(centers + half_extents - 0.5), size - 1), half_extents


def _blend(
    centers: Tensor, covariances: Tensor, opacities: Tensor, channels: Tensor, view: PinholeView
) -> tuple[Tensor, Tensor]:
    """Channels over black [H, W, D] and transmittance [H, W, 1] of Gaussians that are sorted by depth."""
    rows_per_strip = max(1, _PAIRS_PER_STRIP // max(1, view.width * len(centers)))
    strips = []
    for first_row in range(0, view.height, rows_per_strip):
        pixels = _pixel_centers(first_row, min(first_row + rows_per_strip, view.height), view.width).to(centers)
        arguments = (pixels, centers, covariances, opacities, channels)
        if torch.is_grad_enabled() and any(tensor.requires_grad for tensor in arguments):
            strips.append(checkpoint(_blend_pixels, *arguments, use_reentrant=False))
        else:
            strips.append(_blend_pixels(*arguments))
    image, transmittance = (torch.cat(parts) for parts in zip(*strips, strict=True))
    return image.reshape(view.height, view.width, -1), transmittance.reshape(view.height, view.width, 1)


def _pixel_centers(first_row: int, end_row: int, width: int) -> Tensor:
    """Centres of the pixels of some rows, row by row. [P, 2] float64"""
    y, x = np.mgrid[first_row:end_row, 0:width]
    return torch.from_numpy(np.stack([x.ravel(), y.ravel()], -1) + 0.5)


def _blend_pixels(
    pixels: Tensor, centers: Tensor, covariances: Tensor, opacities: Tensor, channels: Tensor
) -> tuple[Tensor, Tensor]:
    """Front-to-back compositing. [P, D] and [P]"""
    dx, dy = (pixels[:, None, :] - centers[None, :, :]).unbind(-1)  # [P, N]
    xx, xy, yy = covariances[:, 0, 0], covariances[:, 0, 1], covariances[:, 1, 1]
    determinant = xx * yy - xy * xy
    exponent = (0.5 * (yy * dx * dx + xx * dy * dy) - xy * dx * dy) / determinant
    alphas = opacities * torch.exp(-exponent)
    alphas = torch.where(alphas >= ALPHA_MIN, alphas.clamp_max(ALPHA_MAX), 0.0)
    is_open = (_transmittance_before(alphas) >= TRANSMITTANCE_MIN).detach()
    alphas = torch.where(is_open, alphas, 0.0)
    before = _transmittance_before(alphas)
    last = before[:, -1] * (1.0 - alphas[:, -1]) if alphas.shape[1] else pixels.new_ones(len(pixels))
    return (alphas * before) @ channels, last


def _transmittance_before(alphas: Tensor) -> Tensor:
    """Light left over in front of each Gaussian. [P, N]"""
    passed = torch.cumprod(1.0 - alphas, 1)
    return torch.cat([torch.ones_like(passed[:, :1]), passed[:, :-1]], 1)
