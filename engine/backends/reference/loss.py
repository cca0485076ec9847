"""The terms of the loss in plain torch, gradients by autograd."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

from engine.backends.backend import PhotometricLoss
from engine.images.ssim_lanes import C1, C2, RADIUS, WINDOW
from engine.raster.pinhole_view import TILE_PX


def photometric_loss_reference(
    image: Tensor,
    truth: Tensor,
    *,
    ssim_weight: float,
    gain: Tensor | None,
    is_counted: Tensor | None,
    tile_mask: Tensor | None,
    rest: Tensor | None,
) -> PhotometricLoss:
    """Arguments are those of `photometric_loss`, already checked."""
    truth = truth.to(image) / 255 if truth.dtype == torch.uint8 else truth.to(image)
    shown = image if gain is None else image * gain
    active = torch.ones(*image.shape[:2], 1, dtype=torch.bool, device=image.device)
    counts = active if is_counted is None else is_counted[..., None]
    if tile_mask is not None:
        pixels = tile_mask.repeat_interleave(TILE_PX, 0).repeat_interleave(TILE_PX, 1)
        active = pixels[: image.shape[0], : image.shape[1], None]
    frozen = truth if rest is None else (rest if gain is None else rest * gain).detach()
    shown = torch.where(counts, torch.where(active, shown, frozen), truth)
    l1 = torch.where(active, (shown - truth).abs(), 0).mean()
    loss = (1 - ssim_weight) * l1 + ssim_weight * (1 - ssim_map(shown, truth).mean())
    return PhotometricLoss(loss, (torch.where(active, shown.detach() - truth, 0) ** 2).mean())


def ssim_map(image: Tensor, truth: Tensor) -> Tensor:
    """SSIM of each pixel and channel, differentiable. [H, W, 3]

    As in 3D Gaussian splatting: 11 x 11 Gaussian window of sigma 1.5, zero padding, per channel, constants 0.01^2 and
    0.03^2.
    """
    window = torch.from_numpy(WINDOW).to(image)
    stack = torch.stack([image, truth, image * image, truth * truth, image * truth])  # [5, H, W, 3]
    planes = stack.permute(0, 3, 1, 2).reshape(1, 15, *image.shape[:2])  # depthwise: channels stay channels
    along = window.view(1, 1, 1, -1).repeat(15, 1, 1, 1)
    planes = functional.conv2d(planes, along, padding=(0, RADIUS), groups=15)
    planes = functional.conv2d(planes, along.transpose(2, 3), padding=(RADIUS, 0), groups=15)
    mu_a, mu_b, aa, bb, ab = planes.reshape(5, 3, *image.shape[:2])
    numerator = (2 * mu_a * mu_b + C1) * (2 * (ab - mu_a * mu_b) + C2)
    denominator = (mu_a**2 + mu_b**2 + C1) * (aa - mu_a**2 + bb - mu_b**2 + C2)
    return (numerator / denominator).permute(1, 2, 0)


def tile_squares_reference(image: Tensor, truth: Tensor, gain: Tensor) -> Tensor:
    """Sums of (image * gain - truth / 255)^2 over tiles. [rows, columns] float64"""
    height, width = truth.shape[:2]
    squares = (image.double() * gain.double() - truth.double() / 255).square().sum(2)
    padded = functional.pad(squares, (0, -width % TILE_PX, 0, -height % TILE_PX))
    return padded.unflatten(1, (-1, TILE_PX)).unflatten(0, (-1, TILE_PX)).sum((1, 3))


def volume_sum_reference(scales: Tensor, unit: float) -> Tensor:
    """Sum of the products of three scales [N, 3], in cubes of `unit` scene units."""
    return (scales / unit).prod(1).sum()
