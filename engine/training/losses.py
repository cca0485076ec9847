"""Photometric loss: (1 - w) L1 + w (1 - SSIM), value and gradient in one fused CPU pass.

SSIM as in 3D Gaussian splatting: 11 x 11 Gaussian window of sigma 1.5, zero padding, per channel, mean, constants
0.01^2 and 0.03^2. Pictures stay [H, W, 3]: a row is a line of 3 W values whose horizontal neighbours lie 3 apart.
`photometric_loss` is the public op; `photometric_loss_reference` is the slow truth it is checked against.
"""

from __future__ import annotations

import numpy as np
import torch
from numba import njit, prange
from torch import Tensor
from torch.nn import functional

_RADIUS = 5
_window = np.exp(-((np.arange(2 * _RADIUS + 1) - _RADIUS) ** 2) / (2 * 1.5**2))
WINDOW = (_window / _window.sum()).astype(np.float32)
C1, C2 = 0.01**2, 0.03**2
_W0, _W1, _W2, _W3, _W4, _W5 = (np.float32(w) for w in WINDOW[: _RADIUS + 1])
_C1, _C2 = np.float32(C1), np.float32(C2)
_ZERO, _ONE, _TWO = np.float32(0), np.float32(1), np.float32(2)


@njit(inline="always")
def _blur_row(padded, out):
    """11-tap blur along x of a row of interleaved RGB with 15 zeros on both ends."""
    for x in range(out.shape[0]):
        out[x] = (
            _W5 * padded[x + 15]
            + _W4 * (padded[x + 12] + padded[x + 18])
            + _W3 * (padded[x + 9] + padded[x + 21])
            + _W2 * (padded[x + 6] + padded[x + 24])
            + _W1 * (padded[x + 3] + padded[x + 27])
            + _W0 * (padded[x] + padded[x + 30])
        )


@njit(inline="always")
def _blur_column(rows, y, out):
    """11-tap blur along y; `rows` has 5 zero rows on both ends."""
    a, b, c, d, e, f = (
        rows[y],
        rows[y + 1],
        rows[y + 2],
        rows[y + 3],
        rows[y + 4],
        rows[y + 5],
    )
    g, h, i, j, k = rows[y + 6], rows[y + 7], rows[y + 8], rows[y + 9], rows[y + 10]
    for x in range(out.shape[0]):
        out[x] = (
            _W5 * f[x]
            + _W4 * (e[x] + g[x])
            + _W3 * (d[x] + h[x])
            + _W2 * (c[x] + i[x])
            + _W1 * (b[x] + j[x])
            + _W0 * (a[x] + k[x])
        )


@njit(
    parallel=True,
    cache=True,
    nogil=True,
    error_model="numpy",
    fastmath={"contract", "nsz", "arcp"},
)
def _loss_kernel(image, truth, weight, moments, partials, gradient, row_sums):
    """image, truth, gradient [H, 3W]; moments [5, H + 10, 3W] and partials [3, H + 10, 3W] with zero borders;
    row_sums [H, 2] receives the sums of |difference| and SSIM of each row."""
    height, width3 = image.shape
    for y in prange(height):
        padded = np.zeros((5, width3 + 30), np.float32)
        for x in range(width3):
            a = image[y, x]
            b = truth[y, x]
            padded[0, x + 15] = a
            padded[1, x + 15] = b
            padded[2, x + 15] = a * a
            padded[3, x + 15] = b * b
            padded[4, x + 15] = a * b
        for m in range(5):
            _blur_row(padded[m], moments[m, y + 5])
    for y in prange(height):
        mean = np.empty((5, width3), np.float32)
        padded = np.zeros((3, width3 + 30), np.float32)
        for m in range(5):
            _blur_column(moments[m], y, mean[m])
        total = _ZERO
        for x in range(width3):
            mu_a, mu_b = mean[0, x], mean[1, x]
            numerator1 = _TWO * mu_a * mu_b + _C1
            numerator2 = _TWO * (mean[4, x] - mu_a * mu_b) + _C2
            denominator1 = mu_a * mu_a + mu_b * mu_b + _C1
            denominator2 = mean[2, x] - mu_a * mu_a + mean[3, x] - mu_b * mu_b + _C2
            inverse = _ONE / (denominator1 * denominator2)
            ssim = numerator1 * numerator2 * inverse
            d_square = -ssim * denominator1 * inverse  # by the blurred a^2
            d_product = _TWO * numerator1 * inverse  # by the blurred a b
            d_mean = (
                _TWO * mu_b * numerator2 * inverse
                - _TWO * mu_a * ssim * denominator2 * inverse
                - _TWO * mu_a * d_square
                - mu_b * d_product
            )
            padded[0, x + 15] = d_mean
            padded[1, x + 15] = d_square
            padded[2, x + 15] = d_product
            total += ssim
        row_sums[y, 1] = total
        for m in range(3):
            _blur_row(padded[m], partials[m, y + 5])
    n = np.float32(height * width3)
    ssim_scale = -weight / n
    l1_scale = (_ONE - weight) / n
    for y in prange(height):
        mean = np.empty((3, width3), np.float32)
        for m in range(3):
            _blur_column(partials[m], y, mean[m])
        total = _ZERO
        for x in range(width3):
            a, b = image[y, x], truth[y, x]
            difference = a - b
            total += abs(difference)
            sign = l1_scale if difference > _ZERO else (-l1_scale if difference < _ZERO else _ZERO)
            gradient[y, x] = sign + ssim_scale * (mean[0, x] + _TWO * a * mean[1, x] + b * mean[2, x])
        row_sums[y, 0] = total


class LossWorkspace:
    """Scratch of one picture size, reused from step to step. Not to be shared between threads."""

    def __init__(self, height: int, width: int) -> None:
        self.moments = np.zeros((5, height + 10, 3 * width), np.float32)
        self.partials = np.zeros((3, height + 10, 3 * width), np.float32)
        self.row_sums = np.zeros((height, 2), np.float64)


class _Photometric(torch.autograd.Function):
    @staticmethod
    def forward(ctx, image: Tensor, truth: Tensor, ssim_weight: float, workspace: LossWorkspace) -> Tensor:
        height = image.shape[0]
        image, truth = image.detach().contiguous(), truth.contiguous()
        gradient = torch.empty_like(image)
        _loss_kernel(
            image.numpy().reshape(height, -1),
            truth.numpy().reshape(height, -1),
            np.float32(ssim_weight),
            workspace.moments,
            workspace.partials,
            gradient.numpy().reshape(height, -1),
            workspace.row_sums,
        )
        l1, ssim = workspace.row_sums.sum(0) / image.numel()
        ctx.gradient = gradient
        return torch.tensor((1 - ssim_weight) * l1 + ssim_weight * (1 - ssim), dtype=image.dtype)

    @staticmethod
    def backward(ctx, *gradients: Tensor):
        (loss_grad,) = gradients
        return ctx.gradient * loss_grad, None, None, None


def photometric_loss(image: Tensor, truth: Tensor, *, ssim_weight: float, workspace: LossWorkspace) -> Tensor:
    """(1 - w) L1 + w (1 - SSIM) of one picture.

    Args:
        image: Rendered, float32. [H, W, 3]
        truth: Same shape; no gradient flows into it.
        ssim_weight: w in 0..1.
        workspace: Scratch for this picture size.
    Returns:
        Scalar, differentiable in `image`. Checked against `photometric_loss_reference`.
    """
    return _Photometric.apply(image, truth, ssim_weight, workspace)  # type: ignore[no-any-return]


def ssim_map(image: Tensor, truth: Tensor) -> Tensor:
    """SSIM of each pixel and channel, any float dtype, differentiable. [H, W, 3]"""
    window = torch.from_numpy(_window / _window.sum()).to(image.dtype)
    stack = torch.stack([image, truth, image * image, truth * truth, image * truth])  # [5, H, W, 3]
    planes = stack.permute(0, 3, 1, 2).reshape(1, 15, *image.shape[:2])  # depthwise: channels stay channels
    planes = functional.conv2d(
        planes,
        window.view(1, 1, 1, -1).repeat(15, 1, 1, 1),
        padding=(0, _RADIUS),
        groups=15,
    )
    planes = functional.conv2d(
        planes,
        window.view(1, 1, -1, 1).repeat(15, 1, 1, 1),
        padding=(_RADIUS, 0),
        groups=15,
    )
    mu_a, mu_b, aa, bb, ab = planes.reshape(5, 3, *image.shape[:2])
    numerator = (2 * mu_a * mu_b + C1) * (2 * (ab - mu_a * mu_b) + C2)
    denominator = (mu_a**2 + mu_b**2 + C1) * (aa - mu_a**2 + bb - mu_b**2 + C2)
    return (numerator / denominator).permute(1, 2, 0)


def photometric_loss_reference(image: Tensor, truth: Tensor, *, ssim_weight: float) -> Tensor:
    """Slow truth of `photometric_loss`, any float dtype, by torch autograd."""
    l1 = (image - truth).abs().mean()
    return (1 - ssim_weight) * l1 + ssim_weight * (1 - ssim_map(image, truth).mean())
